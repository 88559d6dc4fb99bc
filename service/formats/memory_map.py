"""Read-only memory maps of files, and of parts of them."""

from __future__ import annotations

from mmap import ACCESS_READ, ALLOCATIONGRANULARITY, mmap
from pathlib import Path


def map_file(path: Path, start: int = 0, size: int | None = None) -> memoryview:
    """Map a file from byte `start` on; it is unmapped when the last array of the view is gone.

    Parameters
    ----------
    path
        A file that is not empty.
    start
        First byte.
    size
        Bytes, of which there is at least one; None: up to the end of the file.
    """
    ahead = start % ALLOCATIONGRANULARITY
    length = 0 if size is None else size + ahead
    with path.open("rb") as file:
        view = memoryview(mmap(file.fileno(), length, access=ACCESS_READ, offset=start - ahead))
    return view[ahead:]
