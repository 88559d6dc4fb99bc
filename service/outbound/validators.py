"""What a server says to tell one version of a file from another (RFC 9110, section 8.8)."""

from __future__ import annotations

import re
from dataclasses import dataclass
from email.utils import parsedate_to_datetime
from typing import Self

_TAG = re.compile(r'(?:W/)?"[!#-~]{0,256}"')


@dataclass(frozen=True, slots=True)
class Validators:
    """ETag and Last-Modified, as far as they can be relied on."""

    etag: str | None = None
    last_modified: str | None = None

    @classmethod
    def of(cls, headers: dict[str, str]) -> Self:
        """Those of an answer."""
        etag, modified = headers.get("etag"), headers.get("last-modified")
        if etag is not None and not _TAG.fullmatch(etag):
            etag = None
        if modified is not None and not _is_strong(modified, headers.get("date")):
            modified = None
        return cls(etag, modified)

    @property
    def conditions(self) -> dict[str, str]:
        """Headers that ask for the file only if it has changed; empty when nothing can be said."""
        if self.etag is not None:
            return {"If-None-Match": self.etag}
        if self.last_modified is not None:
            return {"If-Modified-Since": self.last_modified}
        return {}

    @property
    def strong(self) -> str | None:
        """What promises equal bytes: the value of If-Range."""
        if self.etag is not None:
            return None if self.etag.startswith("W/") else self.etag
        return self.last_modified


def _is_strong(modified: str, date: str | None) -> bool:
    """Whether the file cannot have changed again within the second that Last-Modified names."""
    if date is None:
        return False
    try:
        age = parsedate_to_datetime(date) - parsedate_to_datetime(modified)
        return modified.isascii() and age.total_seconds() >= 1
    except (ValueError, TypeError):
        return False
