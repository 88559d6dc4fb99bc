"""Reference from a job to a cloud."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

CLOUD_ROLES = ("source", "target")
"""The two clouds of a registration: the source is moved onto the target."""


@dataclass(frozen=True, slots=True)
class CloudInput:
    """A cloud of a job: a stored blob, or a URL until it has been fetched."""

    sha256: str | None = None
    """Hash of the blob; None before the URL has been fetched."""
    size: int | None = None
    """Length of the blob in bytes."""
    url: str | None = None
    cloud: str | None = None
    """Id of the stored cloud that the caller named."""
    reading: dict[str, Any] = field(default_factory=dict)
    """Arguments of `service.formats.read_points` that the caller chose."""

    @property
    def needs_fetching(self) -> bool:
        """Whether it is a URL that has not been fetched yet."""
        return self.sha256 is None and self.url is not None
