"""Selection of scans from files that hold several."""

from __future__ import annotations

from service.formats.errors import MalformedFileError


def select_scans(count: int, scan: int | None) -> tuple[range, tuple[str, ...]]:
    """Select one scan, or all of them.

    Parameters
    ----------
    count
        Number of scans in the file.
    scan
        Index of the wanted scan, from 0; None for all.

    Returns
    -------
    tuple[range, tuple[str, ...]]
        Indices of the selected scans, and a warning when several become one cloud.

    Raises
    ------
    MalformedFileError
        The file has no scan with this index, or none at all.
    """
    if count == 0:
        raise MalformedFileError("the file holds no scan")
    if scan is not None and not 0 <= scan < count:
        raise MalformedFileError(
            f"scan {scan} does not exist; the file has {count}, counted from 0"
        )
    if scan is not None:
        return range(scan, scan + 1), ()
    warnings = (f"{count} scans are merged; set 'scan' to read one",) if count > 1 else ()
    return range(count), warnings
