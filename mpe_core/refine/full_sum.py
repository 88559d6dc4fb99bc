"""From a coarse pose to the minimum of the full-sum potential: for noise beyond the point
spacing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpe_core.geometry.cell_list import Points
from mpe_core.geometry.rigid import apply, cross_matrix
from mpe_core.kernels.potential_moments import potential_moments
from mpe_core.kernels.rigid_motion import update_pose
from mpe_core.refine.minimum import Minimum
from mpe_core.refine.point_to_plane import STILL

Pose = NDArray[np.float64]

EPS = 3.0
"""eps over the noise. Bunny of 1,889 points, 50 seeds, median rotation error over that of the fit
with known correspondences, noise 0.02 / 0.04 / 0.08 / 0.16: eps 1 sigma 2.0 / 2.8 / 2.9 / 3.3, 2
sigma 2.0 / 2.2 / 2.5 / 2.9, 3 sigma 2.1 / 2.2 / 2.5 / 2.5; 2.37 is the limit of any method that
sees a surface without knowing which of its points is which (information of the normal components
alone)."""


def descend_potential(
    source: Points, target: Points, T: Pose, eps: float, motions: NDArray[np.float64], most: int
) -> Minimum:
    """Minimise -sum_ij 1 / (|y_j - (R x_i + t)|^2 + eps^2) over all pairs, from the pose T:
    Newton's method with Levenberg's damping, so that no step raises the energy by more than
    rounding; steps within the `motions` (6, K)."""
    y = np.ascontiguousarray(target.T)
    here = PotentialExpansion(source, y, T, eps)
    damping, iterations, converged = 1e-3, 0, False
    while iterations < most and damping < 1e4 and not converged:
        iterations += 1
        step = here.step(damping, motions)
        there = PotentialExpansion(source, y, here.moved(step), eps) if step is not None else here
        if step is None or there.energy > here.energy * (1 - 1e-7):
            damping = max(8 * damping, 1e-3)
            continue
        converged = bool(np.abs(step).max() < STILL)
        here, damping = there, 0.2 * damping
    return Minimum(here.T, converged, iterations)


class PotentialExpansion:
    """Energy of a pose, with gradient and Hessian over a rotation vector about the moved source's
    centroid and a translation."""

    def __init__(self, source: Points, y: Points, T: Pose, eps: float) -> None:
        self.T = T
        moved = apply(T, source)
        self.centre = moved.mean(axis=0)
        moments = np.empty((len(source), 11), np.float32)
        potential_moments(
            np.ascontiguousarray(moved.T.astype(np.float32)), y, np.float32(eps), moments
        )
        m = moments.astype(np.float64)
        arm = moved - self.centre
        self.energy = -m[:, 0].sum()
        pull = 2 * m[:, 2:5]
        self.pulls = np.concatenate([np.cross(arm, pull), pull], axis=1)
        self.gradient = self.pulls.sum(axis=0)
        self.hessian = self._hessian(m, arm, pull)
        inertia = (arm**2).sum() / len(arm) * 2 / 3
        self.scale = 2 * m[:, 1].sum() * np.array([inertia] * 3 + [1.0] * 3)

    @staticmethod
    def _hessian(
        m: NDArray[np.float64], arm: NDArray[np.float64], pull: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(6, 6) of the energy: the points' own curvature through their arms, plus the turn of the
        arms."""
        xx, xy, xz, yy, yz, zz = m[:, 5:].T
        own = -8 * np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        own[[0, 1, 2], [0, 1, 2]] += 2 * m[:, 1]
        # columns of d p / d (w, v): -[arm]x and the identity
        J = np.zeros((3, 6, len(arm)))
        J[:, :3] = np.moveaxis(cross_matrix(-arm), 0, -1)
        J[[0, 1, 2], [3, 4, 5]] = 1
        H = np.einsum("ian,ijn,jbn->ab", J, own, J, optimize=["einsum_path", (0, 1), (0, 1)])
        turn = np.einsum("ni,nj->ij", pull, arm)
        H[:3, :3] -= (turn + turn.T) / 2 - np.trace(turn) * np.eye(3)
        hessian: NDArray[np.float64] = H
        return hessian

    def step(self, damping: float, motions: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """(6,) damped Newton step, or None where the damped Hessian is not positive definite."""
        H = motions.T @ (self.hessian + damping * np.diag(self.scale)) @ motions
        try:
            np.linalg.cholesky(H)
        except np.linalg.LinAlgError:
            return None
        step: NDArray[np.float64] = motions @ np.linalg.solve(H, motions.T @ self.gradient)
        return step

    def moved(self, step: NDArray[np.float64]) -> Pose:
        """The pose after a step."""
        T = self.T.copy()
        T[:3, 3] -= self.centre
        update_pose(T, step)
        T[:3, 3] += self.centre
        return T
