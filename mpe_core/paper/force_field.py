"""The force field of a fixed target, exact and by a tree."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mpe_core.kernels.pair_sum import pair_force
from mpe_core.kernels.tree_sum import tree_force
from mpe_core.paper.barnes_hut_tree import build_tree

Array = NDArray[np.float64]

CLIP_DISTANCE = 1e9
"""Largest absolute coordinate, in radii; points beyond it are moved there, where squares do not
overflow and forces are next to zero."""

OPENING_RATIO = np.float32(0.2)
"""Radius over distance below which a cell of the tree stands for its points: an error of 5e-5 of
the forces; with 0.3 poses differ visibly from those of the exact sum (docs/tuning.md)."""


class ForceField(Protocol):
    """Static force field of the target."""

    def force(self, points: Array) -> Array:
        """Return the (N, 3) forces F_i on points (N, 3): Eq. 7 with K_i = 1."""


class ExactField:
    """Force field summed over all pairs of points (Eq. 7)."""

    def __init__(self, target: Array, eps: float, weights: Array | None = None) -> None:
        """Take the points that attract.

        Parameters
        ----------
        target
            (M, 3) fixed points.
        eps
            Softening length, in the unit of the points, which bounds the force of a pair.
        weights
            (M,) K_j of the fixed points; all 1 where none are given.
        """
        self._target = _single(target)
        self._weights = np.asarray([] if weights is None else weights, np.float32)
        self._eps = np.float32(eps)

    def force(self, points: Array) -> Array:
        """Return the (N, 3) forces F_i on points (N, 3)."""
        force = np.empty((3, len(points)))
        pair_force(_single(points), self._target, self._weights, self._eps, force)
        return force.T


class TreeField:
    """The same field, with distant points of the target summed as one (Barnes and Hut 1986).

    Takes time M log M to build and N log M for the forces. Fastest for points in an order in which
    neighbors follow each other (`barnes_hut_tree.tree_order`), correct in any order.
    """

    def __init__(self, target: Array, eps: float, weights: Array | None = None) -> None:
        """Build the tree; the parameters are those of `ExactField`."""
        tree = build_tree(_clipped(target), weights)
        self._tree = tree.points, tree.weights, tree.starts, tree.cells
        self._eps = np.float32(eps)

    def force(self, points: Array) -> Array:
        """Return the (N, 3) forces F_i on points (N, 3)."""
        force = np.zeros((3, len(points)))
        tree_force(_single(points), self._tree, self._eps, OPENING_RATIO, force)
        return force.T


def _single(points: Array) -> NDArray[np.float32]:
    """Return points (N, 3) as (3, N) float32, clipped."""
    return np.ascontiguousarray(_clipped(points).T, np.float32)


def _clipped(points: Array) -> Array:
    return np.clip(points, -CLIP_DISTANCE, CLIP_DISTANCE)


def torque_and_gravity(points: Array, center: Array, force: Array) -> tuple[Array, Array]:
    """Return the torque T and the gravitational vector S of a rigid cloud (Eq. 8, 9).

    With v_i the unit vector from the center to point i, T = sum v_i x [F_i - (F_i.v_i) v_i] and
    S = sum (F_i.v_i) v_i.

    Parameters
    ----------
    points, force
        (N, 3) points and the forces F_i on them.
    center
        (3,) center of mass.

    Returns
    -------
    T (3,) and S (3,).
    """
    arm = points - center
    length = np.sqrt(np.einsum("ni,ni->n", arm, arm))
    v = arm / np.maximum(length, np.finfo(np.float64).tiny)[:, None]
    M = np.einsum("ni,nj->ij", v, force)
    # v x [F - (F.v) v] = v x F, because v x v = 0
    torque = np.array([M[1, 2] - M[2, 1], M[2, 0] - M[0, 2], M[0, 1] - M[1, 0]])
    return torque, np.einsum("n,ni->i", np.einsum("ni,ni->n", force, v), v)
