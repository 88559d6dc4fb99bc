"""A file's bytes without reading them first."""

from __future__ import annotations

from mmap import ACCESS_READ, mmap
from pathlib import Path


def mapped(path: Path) -> memoryview:
    """Map a file that is not empty; it is unmapped with the last array made from the view."""
    with path.open("rb") as file:
        return memoryview(mmap(file.fileno(), 0, access=ACCESS_READ))
