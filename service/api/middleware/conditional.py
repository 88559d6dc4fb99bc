"""Conditional GET (RFC 9110, 13): what the caller has already is not sent again."""

from __future__ import annotations

import hashlib

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

NOT_MODIFIED = 304
_OF_THE_BODY = ("content-length", "content-type", "content-disposition")


class ConditionalMiddleware:
    """ASGI middleware that gives ETags to responses to GET, and answers If-None-Match.

    A response whose length is known and that has no ETag gets the hash of its body; one that comes
    in pieces of unknown number is passed on as it is.

    Parameters
    ----------
    app : ASGIApp
        The application inside.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on; compare the tag of its response."""
        if scope["type"] != "http" or scope["method"] != "GET":
            await self._app(scope, receive, send)
            return
        known = Headers(scope=scope).get("if-none-match", "")
        await self._app(scope, receive, _ConditionalSend(send, known).send)


class _ConditionalSend:
    """The sending end of one response."""

    def __init__(self, send: Send, known: str) -> None:
        self._send = send
        self._known = known
        self._start: Message | None = None
        self._is_dropped = False

    async def send(self, message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = Headers(raw=message["headers"])
            if message["status"] == 200 and "content-length" in headers:
                self._start = message
                return
        elif self._start is not None:
            start, self._start = self._start, None
            await self._send_start(start, message)
        if not self._is_dropped:
            await self._send(message)

    async def _send_start(self, start: Message, body: Message) -> None:
        """Send the held head, as 304 without a body where the caller knows the tag."""
        headers = MutableHeaders(raw=start["headers"])
        if "etag" not in headers and not body.get("more_body", False):
            digest = hashlib.sha256(body.get("body", b"")).hexdigest()[:32]
            headers["ETag"] = f'"{digest}"'
        if "etag" in headers and is_known(headers["etag"], self._known):
            self._is_dropped = True
            for name in _OF_THE_BODY:
                del headers[name]
            await self._send({**start, "status": NOT_MODIFIED, "headers": headers.raw})
            await self._send({"type": "http.response.body", "body": b""})
            return
        await self._send({**start, "headers": headers.raw})


def is_known(tag: str, known: str) -> bool:
    """Return whether the value of If-None-Match names the tag, by weak comparison."""
    names = {name.strip().removeprefix("W/") for name in known.split(",")}
    return "*" in names or tag.removeprefix("W/") in names
