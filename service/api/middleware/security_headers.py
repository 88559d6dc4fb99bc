"""Security headers: responses run no scripts, are not framed, and are not cached."""

from __future__ import annotations

from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

SECURITY_HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Content-Security-Policy": "default-src 'none'; frame-ancestors 'none'",
    "Referrer-Policy": "no-referrer",
}
PRIVATE_PREFIX = "/v1/"
"""Paths with data of a tenant; their responses are never cached."""

HSTS = "max-age=31536000"


class SecurityHeadersMiddleware:
    """ASGI middleware that adds security headers to every response.

    Parameters
    ----------
    app : ASGIApp
        The application inside.
    private_prefix : str
        Responses to paths that begin with it get `Cache-Control: no-store`.
    hsts : str
        Strict-Transport-Security of responses over https.
    """

    def __init__(
        self, app: ASGIApp, *, private_prefix: str = PRIVATE_PREFIX, hsts: str = HSTS
    ) -> None:
        self._app = app
        self._private_prefix = private_prefix
        self._hsts = hsts

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on and add the headers to its response."""

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                add_security_headers(headers, scope, self._private_prefix, self._hsts)
            await send(message)

        await self._app(scope, receive, send_with_headers)


def add_security_headers(
    headers: MutableHeaders,
    scope: Scope,
    private_prefix: str = PRIVATE_PREFIX,
    hsts: str = HSTS,
) -> None:
    """Add the security headers that the route has not set itself.

    Strict-Transport-Security is sent over https only, where the server or a trusted proxy speaks
    TLS: browsers ignore it over plain http.
    """
    for name, value in SECURITY_HEADERS.items():
        headers.setdefault(name, value)
    if scope["path"].startswith(private_prefix):
        headers["Cache-Control"] = "no-store"
    if scope["scheme"] == "https":
        headers.setdefault("Strict-Transport-Security", hsts)
