"""Distances of an aligned source from the surface of its target, for files that are decoded."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mpe_core.options import Viewpoints
from service.formats import DecodedCloud

if TYPE_CHECKING:
    from mpe_core import MeshSurface, TargetSurface

MAX_TOLERANCES = 16
"""Tolerances of one request."""
HISTOGRAM_BINS = 60


def build_surface(
    target: DecodedCloud, viewpoint: Viewpoints | None, *, ignores_file: bool
) -> TargetSurface | MeshSurface:
    """Return the surface of a target: of its triangles, if it is a mesh, else of its points.

    Its own faces or normals, else where the scanners stood, tell inside and outside.

    Parameters
    ----------
    target
        Read with its attributes.
    viewpoint
        Position of the scanner in its frame, or of several, where the caller has given it.
    ignores_file
        Whether the positions that the file tells are not taken in its place.
    """
    # loads kernels, which the service process must not
    from mpe_core import MeshSurface, TargetSurface

    if target.mesh is not None and target.mesh.faces is not None:
        return MeshSurface(target.mesh.points, target.mesh.faces)
    if viewpoint is None and not ignores_file:
        viewpoint = target.scanner_positions or None
    return TargetSurface(target.points, target.normals, viewpoint)


def move_points(
    points: NDArray[np.floating], transform: Sequence[Sequence[float]]
) -> NDArray[np.float64]:
    """Return the (N, 3) points moved by a (4, 4) transform."""
    T = np.asarray(transform, np.float64)
    moved: NDArray[np.float64] = points.astype(np.float64) @ T[:3, :3].T + T[:3, 3]
    return moved


def count_histogram(
    distances: NDArray[np.float64], reach: float, is_signed: bool
) -> tuple[list[float], list[int]]:
    """Count distances in bins of equal width up to a reach.

    Returns
    -------
    (HISTOGRAM_BINS + 1) edges and (HISTOGRAM_BINS) counts; values beyond the reach are left out.
    """
    width = reach if reach > 0 else 1.0
    counts, edges = np.histogram(
        distances[np.isfinite(distances)], HISTOGRAM_BINS, (-width if is_signed else 0.0, width)
    )
    return edges.tolist(), counts.tolist()
