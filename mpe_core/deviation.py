"""Deviation: how far each point of an aligned cloud lies from the surface of the other one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mpe_core.geometry.rigid import apply
from mpe_core.surfaces import MeshSurface, TargetSurface

PERCENTILES = (1, 5, 25, 50, 75, 95, 99)
"""Percentiles of a summary, in per cent."""


@dataclass(frozen=True, slots=True)
class DeviationSummary:
    """Statistics of distances, in their unit; those that are not finite are left out."""

    count: int
    """Number of points that count."""
    beyond: int
    """Number of points farther away than `max_distance`, which do not count."""
    mean: float
    std: float
    rms: float
    minimum: float
    maximum: float
    percentiles: dict[int, float]
    """Value by per cent: so many per cent of the points lie below it."""
    shares: dict[float, float]
    """Share of the points, in [0, 1], whose distance is at most a tolerance, either sign."""


@dataclass(frozen=True, slots=True)
class Deviation:
    """Distances of the points of a source from the surface of its target.

    Examples
    --------
    >>> import numpy as np
    >>> from mpe_core import measure_deviation
    >>> x, y = np.random.default_rng(0).uniform(-1, 1, (2, 2000))
    >>> plane = np.column_stack([x, y, 0 * x])
    >>> raised = plane[:100] * 0.5 + [0, 0, 0.01]
    >>> deviation = measure_deviation(raised, plane, np.eye(4), target_viewpoint=(0, 0, 9))
    >>> deviation.is_signed, float(deviation.summarize().mean.__round__(6))
    (True, 0.01)
    """

    distances: NDArray[np.float64]
    """(N,) distances in the unit of the target; NaN for rows that are not finite."""
    is_signed: bool
    """Whether points before the surface (on the side of its normals, or of the nearest viewpoint)
    are positive and points behind it negative; otherwise all are positive."""

    def summarize(
        self, tolerances: Sequence[float] = (), max_distance: float = np.inf
    ) -> DeviationSummary:
        """Return mean, spread, percentiles, and the share within each tolerance.

        Parameters
        ----------
        tolerances
            Distances for which the share of points within them is wanted.
        max_distance
            Points farther away do not count: they have no counterpart.
        """
        finite = self.distances[np.isfinite(self.distances)]
        values = finite[np.abs(finite) <= max_distance]
        size, none = np.abs(values), float("nan")
        has_any = len(values) > 0
        return DeviationSummary(
            count=len(values),
            beyond=len(finite) - len(values),
            mean=float(values.mean()) if has_any else none,
            std=float(values.std()) if has_any else none,
            rms=float(np.sqrt(np.mean(values**2))) if has_any else none,
            minimum=float(values.min()) if has_any else none,
            maximum=float(values.max()) if has_any else none,
            percentiles={
                percent: float(np.percentile(values, percent)) if has_any else none
                for percent in PERCENTILES
            },
            shares={
                float(limit): float(np.mean(size <= limit)) if has_any else none
                for limit in tolerances
            },
        )


def measure_deviation(
    source: ArrayLike,
    target: ArrayLike,
    T_target_source: ArrayLike,
    *,
    target_normals: ArrayLike | None = None,
    target_viewpoint: ArrayLike | None = None,
    target_faces: ArrayLike | None = None,
) -> Deviation:
    """Measure how far each source point lies from the target's surface at a pose.

    Parameters
    ----------
    source, target
        (N, 3) and (M, 3) points.
    T_target_source
        (4, 4) pose of the source in the target's frame, as `register` finds it.
    target_normals
        (M, 3) normals that point out of the target, so that distances have a sign.
    target_viewpoint
        Place (3,) of the scanner in the target's frame, or places (k, 3) of several, for the sign
        where there are no normals.
    target_faces
        (F, 3) triangles of a target that is a mesh, as rows of its points: the distances are those
        from the triangles, exactly, and have a sign where the faces agree about their sides.
    """
    surface: TargetSurface | MeshSurface
    if target_faces is None:
        surface = TargetSurface(target, target_normals, target_viewpoint)
    else:
        surface = MeshSurface(target, target_faces)
    moved = apply(np.asarray(T_target_source, np.float64), np.asarray(source, np.float64))
    return Deviation(surface.measure(moved), surface.is_signed)
