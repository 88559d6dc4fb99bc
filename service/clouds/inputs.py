"""How a registration refers to a cloud."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

CLOUD_ROLES = ("source", "target")
"""The two clouds of a registration: the source is moved onto the target."""


@dataclass(frozen=True, slots=True)
class CloudInput:
    """A cloud as the caller gave it: a stored blob, or a URL until it has been fetched."""

    sha256: str | None = None
    size: int | None = None
    """Length in bytes."""
    url: str | None = None
    cloud: str | None = None
    """Id of the stored cloud that the caller named."""
    reading: dict[str, Any] = field(default_factory=dict)
    """How to read the file, where its content does not tell: arguments of read_points."""
