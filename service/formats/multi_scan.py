"""Which scans of a file with several."""

from __future__ import annotations

from service.formats.errors import MalformedFileError


def chosen(count: int, scan: int | None) -> tuple[range, tuple[str, ...]]:
    """Return the indices of the scans to read, and a warning where several become one cloud.

    Raises
    ------
    MalformedFileError
        The file has no scan of that number, or none at all.
    """
    if scan is not None and not 0 <= scan < count:
        raise MalformedFileError(f"scan {scan} is asked for, the file has {count}, counted from 0")
    if count == 0:
        raise MalformedFileError("the file has no scan")
    if scan is not None:
        return range(scan, scan + 1), ()
    warnings = (f"{count} scans are merged; choose one by its number",) if count > 1 else ()
    return range(count), warnings
