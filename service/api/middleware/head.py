"""HEAD of every resource that has GET: the same status and headers, without the body."""

from __future__ import annotations

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.api.route_methods import route_methods


class HeadMiddleware:
    """ASGI middleware that answers HEAD with the head of the response to GET.

    Paths with a HEAD route of their own keep it.

    Parameters
    ----------
    app : ASGIApp
        The application inside.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, as GET where that is the route."""
        if scope["type"] != "http" or scope["method"] != "HEAD":
            await self._app(scope, receive, send)
            return
        if "HEAD" in route_methods(scope["app"], scope["path"]):
            await self._app(scope, receive, send)
            return
        response = _HeadOnly(receive, send)
        scope["method"] = "GET"
        try:
            await self._app(scope, response.receive, response.send)
        finally:
            scope["method"] = "HEAD"


class _HeadOnly:
    """The two ends of a request whose response stops after its head."""

    def __init__(self, receive: Receive, send: Send) -> None:
        self._receive = receive
        self._send = send
        self._is_complete = False

    async def receive(self) -> Message:
        return {"type": "http.disconnect"} if self._is_complete else await self._receive()

    async def send(self, message: Message) -> None:
        if self._is_complete:
            return
        await self._send(message)
        if message["type"] == "http.response.start":
            self._is_complete = True
            await self._send({"type": "http.response.body", "body": b""})
