"""Deviation: how far each point of an aligned cloud lies from the surface of the other one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mpe_core.geometry.nearest import NearestNeighbors
from mpe_core.geometry.rigid import apply

PLANE_POINTS = 12
"""Points of the target that a plane is fitted to: enough to average noise, few enough for edges."""
MAX_PLANE_VARIATION = 0.1
"""Smallest eigenvalue over the trace above which neighbours are no surface (leaves, noise)."""
MIN_PLANE_WIDTH = 0.02
"""Middle over largest eigenvalue below which neighbours lie on a line (one beam of a scanner)."""
PERCENTILES = (1, 5, 25, 50, 75, 95, 99)
"""Percentiles of a summary, in per cent."""
_BATCH = 200_000
"""Queries of which the neighbourhoods are held at once."""


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
    """Whether points before the surface (on the side of its normals, or of the viewpoint) are
    positive and points behind it negative; otherwise all are positive."""

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


class TargetSurface:
    """The surface that the points of a target sample: a plane around each of them.

    Parameters
    ----------
    points
        (M, 3) the target; rows that are not finite are left out.
    normals
        (M, 3) normals that point out of the surface, of any length; None: unknown.
    viewpoint
        Position of the scanner, which saw the outside; counts where there are no normals.
    """

    def __init__(
        self,
        points: ArrayLike,
        normals: ArrayLike | None = None,
        viewpoint: ArrayLike | None = None,
    ) -> None:
        cloud = np.asarray(points, np.float64)
        rows = np.isfinite(cloud).all(axis=1)
        self._points = cloud[rows]
        self._tree = NearestNeighbors(self._points)
        self._normals = None if normals is None else np.asarray(normals, np.float64)[rows]
        self._viewpoint = None if viewpoint is None else np.asarray(viewpoint, np.float64)
        self.is_signed = normals is not None or viewpoint is not None

    def measure(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """Return the (N,) distances of points (N, 3) in the frame of the target.

        The distance is that from the plane through the nearest target points. It is never more
        than that from the nearest point itself, which counts beyond the edge of the surface and
        where the neighbours are no surface.
        """
        distances = np.full(len(points), np.nan)
        finite = np.flatnonzero(np.isfinite(points).all(axis=1))
        if len(self._points) == 0:
            return distances
        for start in range(0, len(finite), _BATCH):
            rows = finite[start : start + _BATCH]
            distances[rows] = self._measure_batch(points[rows].astype(np.float64))
        return distances

    def _measure_batch(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        straight, nearest = self._tree.nearest(points)
        places, where = np.unique(nearest, return_inverse=True)
        centers, normals, limits = (values[where] for values in self._fit_planes(places))
        offset = points - centers
        height = np.einsum("ni,ni->n", offset, normals)
        aside = points - self._points[nearest] - height[:, None] * normals
        has_plane = np.einsum("ni,ni->n", aside, aside) <= limits
        size = np.where(has_plane, np.minimum(np.abs(height), straight), straight)
        return np.where(height < 0, -size, size) if self.is_signed else size

    def _fit_planes(
        self, places: NDArray[np.int64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Fit planes around rows of the target.

        Returns
        -------
        (K, 3) points of the planes.
        (K, 3) unit normals, to the outside where it is known.
        (K,) squared radii of the neighbourhoods; -1 where they are no surface.
        """
        middle = self._points[places]
        reach, rows = self._tree.nearest_of(middle, min(PLANE_POINTS, len(self._points)))
        around = self._points[rows]
        centers = around.mean(axis=1)
        spread = around - centers[:, None]
        eigenvalues, axes = np.linalg.eigh(np.einsum("kni,knj->kij", spread, spread))
        normals = self._orient(axes[:, :, 0], middle, places)
        low, mid, high = eigenvalues.T
        is_surface = (low <= MAX_PLANE_VARIATION * (low + mid + high)) & (
            mid > MIN_PLANE_WIDTH * high
        )
        return centers, normals, np.where(is_surface, reach[:, -1] ** 2, -1.0)

    def _orient(
        self, axes: NDArray[np.float64], middle: NDArray[np.float64], places: NDArray[np.int64]
    ) -> NDArray[np.float64]:
        if self._normals is not None:
            outside = self._normals[places]
        elif self._viewpoint is not None:
            outside = self._viewpoint - middle
        else:
            return axes
        is_inward = np.einsum("ni,ni->n", axes, outside) < 0
        turned: NDArray[np.float64] = np.where(is_inward[:, None], -axes, axes)
        return turned


def measure_deviation(
    source: ArrayLike,
    target: ArrayLike,
    T_target_source: ArrayLike,
    *,
    target_normals: ArrayLike | None = None,
    target_viewpoint: ArrayLike | None = None,
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
        Position of the scanner in the target's frame, for the sign where there are no normals.
    """
    surface = TargetSurface(target, target_normals, target_viewpoint)
    moved = apply(np.asarray(T_target_source, np.float64), np.asarray(source, np.float64))
    return Deviation(surface.measure(moved), surface.is_signed)
