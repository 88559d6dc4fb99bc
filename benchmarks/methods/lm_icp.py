"""LM-ICP (Fitzgibbon 2003): Levenberg-Marquardt on the distance transform of the target."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import distance_transform_edt, map_coordinates
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from benchmarks.methods.method import Array, Method, diagonal, version_of
from mpe_core.geometry.rigid import apply, pose

CELLS = 100  # of the distance transform along the diagonal
MARGIN = 0.3  # of the diagonal around the target
KERNEL = 0.05  # of the Huber loss, in diagonals


def run(source: Array, target: Array) -> Array:
    """Return the pose T_target_source that the method finds."""
    unit, origin = diagonal(target), target.mean(axis=0)
    x, y = (source - source.mean(axis=0)) / unit, (target - origin) / unit
    corner = y.min(axis=0) - MARGIN
    shape = np.ceil((np.ptp(y, axis=0) + 2 * MARGIN) * CELLS).astype(int) + 1
    empty = np.ones(shape, bool)
    empty[tuple(np.rint((y - corner) * CELLS).astype(int).T)] = False
    field = distance_transform_edt(empty).astype(np.float32) / CELLS

    def motion(p: Array) -> Array:
        return pose(Rotation.from_rotvec(p[:3]).as_matrix(), p[3:])

    def residual(p: Array) -> Array:
        place = (apply(motion(p), x) - corner).T * CELLS
        return map_coordinates(field, place, order=1, mode="nearest").astype(np.float64)

    found = least_squares(residual, np.zeros(6), loss="huber", f_scale=KERNEL, diff_step=1e-3)
    T = motion(found.x)
    T[:3, 3] = unit * T[:3, 3] + origin - T[:3, :3] @ source.mean(axis=0)
    return T


LM_ICP = Method(
    "LM-ICP", version_of("scipy"), run, "100 cells along the diagonal, Huber loss of 5 % of it"
)
