"""What every answer tells a browser: trust nothing that it holds, keep none of it.

And which other pages may ask, if any.
"""

from __future__ import annotations

from typing import Any

from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

ALWAYS = {
    "X-Content-Type-Options": "nosniff",
    "Content-Security-Policy": "default-src 'none'; frame-ancestors 'none'",
    "Referrer-Policy": "no-referrer",
}
PRIVATE = "/v1/"
HSTS = "max-age=31536000"

CORS: dict[str, Any] = {
    "allow_methods": ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE"),
    "allow_headers": (
        "Authorization",
        "Content-Type",
        "Idempotency-Key",
        "Last-Event-ID",
        "Prefer",
        "Tus-Resumable",
        "Upload-Length",
        "Upload-Offset",
        "X-Request-ID",
    ),
    "expose_headers": (
        "Content-Disposition",
        "Location",
        "Preference-Applied",
        "Retry-After",
        "Tus-Resumable",
        "Upload-Expires",
        "Upload-Length",
        "Upload-Offset",
        "WWW-Authenticate",
        "X-Request-ID",
    ),
}
"""What pages of MPE_CORS_ORIGINS may send and read; no cookies, there are none."""


def protect(headers: MutableHeaders, scope: Scope) -> None:
    """Add what the route has not set itself; what belongs to a tenant is never cached.

    Strict-Transport-Security only where TLS is spoken, here or by a proxy that is trusted to say
    so: elsewhere browsers have to ignore it.
    """
    for name, value in ALWAYS.items():
        headers.setdefault(name, value)
    if scope["path"].startswith(PRIVATE):
        headers["Cache-Control"] = "no-store"
    if scope["scheme"] == "https":
        headers.setdefault("Strict-Transport-Security", HSTS)


class SecurityHeadersMiddleware:
    """ASGI middleware."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on; the answer is protected."""

        async def send_protected(message: Message) -> None:
            if message["type"] == "http.response.start":
                protect(MutableHeaders(scope=message), scope)
            await send(message)

        await self._app(scope, receive, send_protected)
