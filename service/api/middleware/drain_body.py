"""Reading on for a while when a request is answered before its body has arrived.

A connection that is closed with bytes unread is reset, and the client may never see the answer
(a 413, for instance). What is read here is thrown away.
"""

from __future__ import annotations

import asyncio

from starlette.types import ASGIApp, Message, Receive, Scope, Send

LINGER_BYTES = 64 * 2**20
LINGER_S = 5.0


class DrainBodyMiddleware:
    """ASGI middleware."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, and linger before an early answer."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        body = _Body(scope, receive)

        async def send_after_body(message: Message) -> None:
            if message["type"] == "http.response.start":
                await body.discard()
            await send(message)

        await self._app(scope, body.receive, send_after_body)


class _Body:
    def __init__(self, scope: Scope, receive: Receive) -> None:
        headers = dict(scope["headers"])
        self._receive = receive
        self._pending = b"content-length" in headers or b"transfer-encoding" in headers
        # a client that waits for "100 Continue" sends nothing before it has been asked to
        self._held_back = b"expect" in headers

    async def receive(self) -> Message:
        self._held_back = False
        message = await self._receive()
        self._pending = message["type"] == "http.request" and message.get("more_body", False)
        return message

    async def discard(self) -> None:
        """Read what is still to come, within bounds."""
        if self._held_back or not self._pending:
            return
        left = LINGER_BYTES
        try:
            async with asyncio.timeout(LINGER_S):
                while self._pending and left > 0:
                    left -= len((await self.receive()).get("body", b""))
        except TimeoutError:
            return
