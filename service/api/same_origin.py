"""Where a request without a key may come from: not from a page of another site.

Such a page runs in the browser of somebody who reaches the service. It can let its own name lead to
the service's address (DNS rebinding), which `Host` then tells, or send forms to the service, which
`Origin` tells. A key keeps both out: a page has none.
"""

from __future__ import annotations

from ipaddress import ip_address
from urllib.parse import urlsplit

from fastapi import Request

from service.problems import HostRefusedError, OriginRefusedError
from service.settings import Settings

CHANGES_NOTHING = ("GET", "HEAD", "OPTIONS")


def check_origin(request: Request, settings: Settings) -> None:
    """Check a request that has no key.

    Raises
    ------
    HostRefusedError
        It calls the service by a name that is not localhost, a loopback address, or one of
        MPE_ALLOWED_HOSTS. Where strangers are welcome (MPE_ALLOW_OPEN), any name will do unless
        some are listed.
    OriginRefusedError
        It would change something, and is sent by a page that is neither the service's own nor of
        MPE_CORS_ORIGINS.
    """
    host, origin = (request.headers.get(name, "").lower() for name in ("host", "origin"))
    if not _is_known(host, settings):
        raise HostRefusedError(
            "Without keys the service answers to localhost and to the names that "
            "MPE_ALLOWED_HOSTS lists; add this one, or make a key with `mpe keys create`."
        )
    if request.method in CHANGES_NOTHING or not origin or "*" in settings.cors_origins:
        return
    if origin not in (f"http://{host}", f"https://{host}", *settings.cors_origins):
        raise OriginRefusedError(
            "Without keys a page of another origin may change nothing; list its origin in "
            "MPE_CORS_ORIGINS, or make a key with `mpe keys create`."
        )


def _is_known(host: str, settings: Settings) -> bool:
    if settings.allow_open and not settings.allowed_hosts:
        return True
    try:
        name = urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return False
    return name == "localhost" or name in settings.allowed_hosts or _is_loopback(name)


def _is_loopback(name: str) -> bool:
    """Whether it is such an address; a name is not asked where it leads."""
    try:
        return ip_address(name).is_loopback
    except ValueError:
        return False
