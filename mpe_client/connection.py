"""Where the service is, and with which key it is called."""

from __future__ import annotations

import os
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any, Self

DEFAULT_URL = "http://127.0.0.1:8000"
TIMEOUT_S = 60.0
"""Seconds without a byte after which a request is given up, and tried again."""


@dataclass(frozen=True, slots=True)
class Connection:
    """Address and key of a service."""

    url: str
    key: str | None

    @classmethod
    def of(cls, url: str | None, key: str | None) -> Self:
        """Take what is given, else MPE_CLIENT_URL and MPE_CLIENT_KEY, else the defaults."""
        address = url or os.environ.get("MPE_CLIENT_URL") or DEFAULT_URL
        return cls(address.rstrip("/"), key or os.environ.get("MPE_CLIENT_KEY") or None)

    @property
    def arguments(self) -> dict[str, Any]:
        """Arguments of the HTTP client of either kind."""
        headers = {"User-Agent": f"mpe-client/{version('mpe')}"}
        if self.key is not None:
            headers["Authorization"] = f"Bearer {self.key}"
        return {"base_url": self.url, "headers": headers, "timeout": TIMEOUT_S}
