"""Protection of a service without keys against web pages of other sites.

A page in the browser of somebody who can reach the service may resolve its own host name to the
service's address (DNS rebinding; the `Host` header shows it) or post forms to the service (CSRF;
the `Origin` header shows it). Requests with a key need no such check: a page does not have one.
"""

from __future__ import annotations

from urllib.parse import urlsplit

from fastapi import Request

from service.auth.bind_check import is_loopback_address
from service.problems import HostRefusedError, OriginRefusedError
from service.settings import Settings

SAFE_METHODS = ("GET", "HEAD", "OPTIONS")
"""Methods that change nothing (RFC 9110, 9.2.1)."""


def check_origin(request: Request, settings: Settings) -> None:
    """Check Host and Origin of a request that has no key.

    Raises
    ------
    HostRefusedError
        Its Host is neither localhost, nor a loopback address, nor listed in MPE_ALLOWED_HOSTS. With
        MPE_ALLOW_ANONYMOUS_REMOTE any host is accepted as long as that list is empty.
    OriginRefusedError
        Its method is not safe, and its Origin is neither the service itself nor listed in
        MPE_CORS_ORIGINS.
    """
    host, origin = (request.headers.get(name, "").lower() for name in ("host", "origin"))
    if not _is_allowed_host(host, settings):
        raise HostRefusedError(
            "Without keys the service accepts the host localhost and those in MPE_ALLOWED_HOSTS; "
            "add this host there, or make a key with `mpe keys create`."
        )
    if request.method in SAFE_METHODS or not origin or "*" in settings.cors_origins:
        return
    if origin not in (f"http://{host}", f"https://{host}", *settings.cors_origins):
        raise OriginRefusedError(
            "Without keys pages of other origins may only read; add this origin to "
            "MPE_CORS_ORIGINS, or make a key with `mpe keys create`."
        )


def _is_allowed_host(host: str, settings: Settings) -> bool:
    if settings.allow_anonymous_remote and not settings.allowed_hosts:
        return True
    try:
        name = urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return False
    return name == "localhost" or name in settings.allowed_hosts or is_loopback_address(name)
