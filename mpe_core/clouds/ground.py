"""The dominant plane of a cloud: the ground of a levelled scan, a floor or a ceiling."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

Array = NDArray[np.float64]

MAX_POINTS, MAX_REFIT_POINTS = 600, 3000
"""Points that vote for planes, and that the best plane is fitted to."""

PLANES, NEIGHBORS = 100, 24
"""Planes that are tried, each through a point and two of its nearest neighbors: these are close
enough to lie on one plane, and far enough apart to tell its tilt."""

PLANE_TOL = 0.012
"""Distance from a plane that counts as on it, in radii of the smaller cloud."""

OFF_PLANE_TOL = 0.03
"""Distance from which on a point lies above or below a plane, in radii of the smaller cloud."""

REFIT_TOLS = (0.03, 0.015, 0.01)
"""Distances within which points refine the plane, one after the other."""

EXTREMAL_WEIGHT = 1 / 0.3
"""Preference for planes that have all else on one side, over those with more points."""


SLAB_HEIGHT, MIN_SLAB_SHARE = 0.03, 0.085
"""Height of a slab across the commonest normal, in radii of the smaller cloud, and the share of the
points that one holds where a ground stands out: a test of 0.3 ms (docs/tuning.md)."""


@dataclass(frozen=True, slots=True)
class Ground:
    """Plane up . x = height, with most of the other points above it."""

    up: Array
    """(3,) unit normal."""
    height: float
    """Height of the plane along `up`."""
    share: float
    """Share of the points that lie on it."""
    is_extremal: bool
    """Whether nearly all other points lie above it: `up` is certain."""

    def flipped(self) -> Ground:
        """Return the same plane with all else below it."""
        return Ground(-self.up, -self.height, self.share, self.is_extremal)

    def opposite(self, points: NDArray[np.float32]) -> Ground:
        """Return the plane that bounds the points (N, 3) above this one: a ceiling for a floor."""
        height = np.einsum("ni,i->n", points.astype(np.float64), self.up)
        above = height[height > self.height + OFF_PLANE_TOL]
        if not len(above):
            return self.flipped()
        slab, counts = np.unique(np.floor(above / PLANE_TOL).astype(np.int64), return_counts=True)
        densest = (slab[np.argmax(counts)] + 0.5) * PLANE_TOL
        top = float(np.median(above[np.abs(above - densest) < 1.5 * PLANE_TOL]))
        share = float((np.abs(height - top) < PLANE_TOL).mean())
        return Ground(-self.up, -top, share, True)


def stands_out(points: NDArray[np.float32], normals: NDArray[np.float32]) -> bool:
    """Tell quickly whether a plane dominates points (N, 3) with these normals (N, 3).

    The floor of a room does not: its walls have as many normals.
    """
    n = normals.astype(np.float64)
    _, axes = np.linalg.eigh(np.einsum("ni,nj->ij", n, n))
    height = np.einsum("ni,i->n", points.astype(np.float64), axes[:, -1])
    _, counts = np.unique(np.floor(height / SLAB_HEIGHT), return_counts=True)
    return bool(counts.max() >= MIN_SLAB_SHARE * len(points))


def find_ground(points: NDArray[np.float32], seed: int = 0) -> Ground:
    """Find the plane with the most points (N, 3) on it and all others on one side.

    A cloud of too few points has a plane with a share of 0.
    """
    rng = np.random.default_rng(seed)
    drawn = rng.permutation(len(points))
    x = points[drawn[:MAX_REFIT_POINTS]].astype(np.float64)
    voters = x[:MAX_POINTS]
    normals, heights = _planes(voters, rng)
    if not len(normals):
        return Ground(np.array([0.0, 0.0, 1.0]), 0.0, 0.0, False)
    off = np.einsum("ni,ki->nk", voters, normals) - heights
    on = (np.abs(off) < PLANE_TOL).mean(axis=0)
    above, below = (off > OFF_PLANE_TOL).mean(axis=0), (off < -OFF_PLANE_TOL).mean(axis=0)
    one_sided = np.abs(above - below) / np.maximum(above + below, 1e-9)
    best = int(np.argmax(on * (1 + EXTREMAL_WEIGHT * one_sided)))
    up, height = _refit(x, normals[best], heights[best])
    off_best = np.einsum("ni,i->n", x, up) - height
    n_above, n_below = (off_best > OFF_PLANE_TOL).sum(), (off_best < -OFF_PLANE_TOL).sum()
    sign = 1.0 if n_above >= n_below else -1.0
    is_extremal = bool(min(n_above, n_below) < 0.1 * max(n_above, n_below))
    share = float((np.abs(off_best) < PLANE_TOL).mean())
    return Ground(sign * up, sign * height, share, is_extremal)


def _planes(x: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """(K, 3) unit normals and (K,) heights of planes through triples of close points."""
    if len(x) <= NEIGHBORS:
        return np.empty((0, 3)), np.empty(0)
    anchors = rng.permutation(len(x))[:PLANES]
    neighbors = np.asarray(KDTree(x).query(x[anchors], NEIGHBORS)[1])
    # the nearer half to the one side, the farther half to the other: never the same point
    half, rows = NEIGHBORS // 2, np.arange(len(anchors))
    b = x[neighbors[rows, rng.integers(half // 2, half, len(anchors))]]
    c = x[neighbors[rows, rng.integers(half, NEIGHBORS, len(anchors))]]
    a = x[anchors]
    normals = np.cross(b - a, c - a)
    length = np.sqrt(np.einsum("ni,ni->n", normals, normals))
    wide = np.flatnonzero(length > 1e-4)
    unit = normals[wide] / length[wide, None]
    return unit, np.einsum("ni,ni->n", unit, a[wide])


def _refit(x: Array, up: Array, height: float) -> tuple[Array, float]:
    """Fit the plane to the points within shrinking distances of it."""
    for tolerance in REFIT_TOLS:
        near = x[np.abs(np.einsum("ni,i->n", x, up) - height) < tolerance]
        if len(near) < 3:
            break
        centre = near.mean(axis=0)
        offset = near - centre
        _, axes = np.linalg.eigh(np.einsum("ni,nj->ij", offset, offset))
        normal = axes[:, 0]
        up = normal if normal @ up > 0 else -normal
        height = float(centre @ up)
    return up, height
