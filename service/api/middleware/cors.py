"""Cross-origin resource sharing: what pages of MPE_CORS_ORIGINS may send and read."""

from __future__ import annotations

from typing import Any

CORS_OPTIONS: dict[str, Any] = {
    "allow_methods": ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE"),
    "allow_headers": (
        "Authorization",
        "Content-Type",
        "Idempotency-Key",
        "If-None-Match",
        "Last-Event-ID",
        "Prefer",
        "Tus-Resumable",
        "Upload-Length",
        "Upload-Offset",
        "X-Request-ID",
    ),
    "expose_headers": (
        "Content-Disposition",
        "ETag",
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
"""Arguments of Starlette's CORSMiddleware. Cookies are not allowed: the service uses none."""
