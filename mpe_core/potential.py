"""The force field of a fixed reference cloud, and the P2 criterion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpe_core.kernels.pair_sum import pair_force

Array = NDArray[np.float64]

FARTHEST = 1e9  # in radii: nothing so far away pulls noticeably


class ExactField:
    """Static field of the target: forces on any points by the direct sum over all pairs (Eq. 7).

    eps (in the unit of the points) bounds the force of one pair.
    """

    def __init__(self, target: Array, eps: float) -> None:
        self._target = _single(target)
        self._eps = np.float32(eps)

    def force(self, points: Array) -> Array:
        """(N, 3) forces F_i on points (N, 3)."""
        force = np.empty((3, len(points)))
        pair_force(_single(points), self._target, self._eps, force)
        return force.T


def _single(points: Array) -> NDArray[np.float32]:
    """(3, N) float32; what lies beyond FARTHEST is moved there, where squares do not overflow."""
    return np.ascontiguousarray(np.clip(points, -FARTHEST, FARTHEST).T, np.float32)


def traction(points: Array, centre: Array, force: Array) -> tuple[Array, Array]:
    """Torque T and gravitational vector S of a rigid cloud about its centre (Eq. 8, 9), each (3,).

    With v_i the unit vector from the centre to point i: T = sum v_i x [F_i - (F_i.v_i) v_i] and
    S = sum (F_i.v_i) v_i.
    """
    arm = points - centre
    v = arm / np.maximum(np.linalg.norm(arm, axis=1), np.finfo(np.float64).tiny)[:, None]
    radial = (force * v).sum(axis=1)[:, None] * v
    return np.cross(v, force - radial).sum(axis=0), radial.sum(axis=0)


def p2_energy(distance: Array, eps: float) -> float:
    """P2 criterion (Eq. 10) of a pose from the distances (N,) of the source points to their nearest
    target points, K_i = eps^2: -mean eps^2 / (d^2 + eps^2), in [-1, 0]; lower is better."""
    return -float(np.mean(eps**2 / (distance**2 + eps**2)))
