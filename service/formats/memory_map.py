"""Read-only memory maps of files."""

from __future__ import annotations

from mmap import ACCESS_READ, mmap
from pathlib import Path


def map_file(path: Path) -> memoryview:
    """Map a non-empty file; it is unmapped when the last array made from the view is gone."""
    with path.open("rb") as file:
        return memoryview(mmap(file.fileno(), 0, access=ACCESS_READ))
