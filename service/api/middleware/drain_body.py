"""Draining the request body before an early response.

The kernel resets a connection that is closed with unread bytes, and the client may then lose the
response (a 413, for instance). So the rest of the body is read and discarded first.
"""

from __future__ import annotations

import asyncio

from starlette.types import ASGIApp, Message, Receive, Scope, Send


class DrainBodyMiddleware:
    """ASGI middleware that reads the rest of a request body before its response is sent.

    Parameters
    ----------
    app : ASGIApp
        The application inside.
    max_bytes : int
        Most bytes to discard per request.
    timeout_s : float
        Longest time to wait for the rest, in seconds.
    """

    def __init__(
        self, app: ASGIApp, *, max_bytes: int = 64 * 2**20, timeout_s: float = 5.0
    ) -> None:
        self._app = app
        self._max_bytes = max_bytes
        self._timeout_s = timeout_s

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on; drain its body before the response starts."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        body = _RequestBody(scope, receive)

        async def send_after_body(message: Message) -> None:
            if message["type"] == "http.response.start":
                await body.discard(self._max_bytes, self._timeout_s)
            await send(message)

        await self._app(scope, body.receive, send_after_body)


class _RequestBody:
    """The `receive` of a request, which knows whether more of the body is to come."""

    def __init__(self, scope: Scope, receive: Receive) -> None:
        headers = dict(scope["headers"])
        self._receive = receive
        self._is_incomplete = b"content-length" in headers or b"transfer-encoding" in headers
        # with "Expect: 100-continue" the client sends nothing until the first receive()
        self._is_held_back = b"expect" in headers

    async def receive(self) -> Message:
        self._is_held_back = False
        message = await self._receive()
        self._is_incomplete = message["type"] == "http.request" and message.get("more_body", False)
        return message

    async def discard(self, max_bytes: int, timeout_s: float) -> None:
        """Read and discard the rest, within the bounds."""
        if self._is_held_back:
            return
        try:
            async with asyncio.timeout(timeout_s):
                while self._is_incomplete and max_bytes > 0:
                    max_bytes -= len((await self.receive()).get("body", b""))
        except TimeoutError:
            return
