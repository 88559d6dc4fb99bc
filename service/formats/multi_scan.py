"""Files that hold several scans: which are read, and from where each was measured."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from service.formats.errors import MalformedFileError

_RIGID_TOL = 1e-3
"""Deviation of the determinant from 1 up to which a matrix is taken for a pose."""


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


def to_viewpoints(poses: Iterable[NDArray[np.float64] | None]) -> tuple[tuple[float, ...], ...]:
    """Return tx, ty, tz, qw, qx, qy, qz of the pose (4, 4) of each scan.

    None at all if one of them is unknown, or if several scans have the same: their points were
    moved into one frame, and where the scanners stood there is lost.
    """
    told = [None if T is None else _to_viewpoint(T) for T in poses]
    known = tuple(viewpoint for viewpoint in told if viewpoint is not None)
    is_lost = len(known) > 1 and len(set(known)) == 1
    return () if len(known) < len(told) or is_lost else known


def _to_viewpoint(T: NDArray[np.float64]) -> tuple[float, ...] | None:
    from scipy.spatial.transform import Rotation  # the service itself loads no scipy

    if not np.isfinite(T).all() or abs(np.linalg.det(T[:3, :3]) - 1) > _RIGID_TOL:
        return None
    x, y, z, w = Rotation.from_matrix(T[:3, :3]).as_quat().tolist()
    return (*T[:3, 3].tolist(), w, x, y, z)
