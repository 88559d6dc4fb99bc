"""Addresses as they may be shown, logged and kept: what lets somebody in is left out."""

from __future__ import annotations

from urllib.parse import urlsplit, urlunsplit


def shown(url: str | None) -> str | None:
    """The URL without user, password, query and fragment: a query may hold a signature."""
    if url is None:
        return None
    parts = urlsplit(url)
    return urlunsplit((parts.scheme, parts.netloc.rpartition("@")[2], parts.path, "", ""))
