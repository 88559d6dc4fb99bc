"""URLs in one canonical spelling, so that the URL that is checked is the URL that is called."""

from __future__ import annotations

import re
from dataclasses import dataclass
from ipaddress import IPv4Address, IPv6Address
from urllib.parse import urlsplit, urlunsplit

from service.outbound.errors import AddressRefusedError

DEFAULT_PORTS = {"http": 80, "https": 443}
_VISIBLE = re.compile(r"[!-\[\]-~]+")  # of ASCII, and no backslash
_AUTHORITY = re.compile(r"(\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9._-]+)(?::([0-9]{1,5}))?")
_LABEL = re.compile(r"(?!-)[a-z0-9_-]{1,63}(?<!-)")
_NUMBER = re.compile(r"[0-9]+|0x[0-9a-f]*")
MAX_HOST_LENGTH = 253


@dataclass(frozen=True, slots=True)
class Url:
    """An http or https URL in canonical spelling, without user, password and fragment."""

    scheme: str
    host: str
    """A name in lower case, or an IP address in canonical spelling without brackets."""
    port: int
    target: str
    """Path and query, percent-encoded."""

    @property
    def authority(self) -> str:
        """Host, and port unless it is the default of the scheme: the value of the Host header."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return host if self.port == DEFAULT_PORTS[self.scheme] else f"{host}:{self.port}"

    def __str__(self) -> str:
        return f"{self.scheme}://{self.authority}{self.target}"


def parse_url(text: str) -> Url:
    """Parse a URL strictly.

    Raises
    ------
    AddressRefusedError
        It is not http or https, names a user, or has a spelling that parsers read differently:
        control characters, blanks, backslashes, names that are not ASCII, zone ids, trailing dots,
        IPv4 addresses that are not four decimal numbers.
    """
    if not _VISIBLE.fullmatch(text):
        raise AddressRefusedError(
            "A URL must consist of visible ASCII characters without backslashes; percent-encode "
            "its path, and write an international host name in its form that begins with xn--."
        )
    try:
        parts = urlsplit(text)
    except ValueError:
        raise AddressRefusedError("The URL is not valid: expected http(s)://host/path.") from None
    if parts.scheme not in DEFAULT_PORTS:
        raise AddressRefusedError("A URL must be http or https.")
    if "@" in parts.netloc:
        raise AddressRefusedError("A URL must name no user and no password.")
    match = _AUTHORITY.fullmatch(parts.netloc)
    if match is None:
        raise AddressRefusedError("The URL's host and port are not valid: expected host:port.")
    port = int(match[2] or DEFAULT_PORTS[parts.scheme])
    if not 0 < port < 65536:
        raise AddressRefusedError("The URL's port must be between 1 and 65535.")
    query = f"?{parts.query}" if parts.query else ""
    return Url(parts.scheme, _canonical_host(match[1]), port, (parts.path or "/") + query)


def _canonical_host(text: str) -> str:
    host = text.lower()
    try:
        if host.startswith("["):
            return str(IPv6Address(host[1:-1]))
        if _NUMBER.fullmatch(host.rpartition(".")[2]):
            return str(IPv4Address(host))
    except ValueError:
        raise AddressRefusedError(
            "The URL's host is not an IP address in its usual form."
        ) from None
    if len(host) > MAX_HOST_LENGTH or not all(map(_LABEL.fullmatch, host.split("."))):
        raise AddressRefusedError("The URL's host is not a valid host name.")
    return host


def redact_url(url: str | None) -> str | None:
    """Drop user info, query and fragment, which may hold credentials or signatures."""
    if url is None:
        return None
    parts = urlsplit(url)
    return urlunsplit((parts.scheme, parts.netloc.rpartition("@")[2], parts.path, "", ""))
