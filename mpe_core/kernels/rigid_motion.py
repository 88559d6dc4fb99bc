"""Update of a pose by a small rigid motion."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit("void(float64[:, ::1], float64[::1])", cache=True)
def update_pose(T, step):
    """Replace the pose T by M T, in place, where M is a rigid motion about the frame's origin.

    Parameters
    ----------
    T
        (4, 4) pose.
    step
        (6,) rotation vector in radians and translation of M.
    """
    angle = np.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
    if angle < 1e-12:
        a, b = 1.0, 0.5
    else:
        a, b = np.sin(angle) / angle, (1.0 - np.cos(angle)) / (angle * angle)
    wx, wy, wz = step[0], step[1], step[2]
    for c in range(4):
        x, y, z = T[0, c], T[1, c], T[2, c]
        # Rodrigues: p + a w x p + b w x (w x p)
        ux, uy, uz = wy * z - wz * y, wz * x - wx * z, wx * y - wy * x
        T[0, c] = x + a * ux + b * (wy * uz - wz * uy)
        T[1, c] = y + a * uy + b * (wz * ux - wx * uz)
        T[2, c] = z + a * uz + b * (wx * uy - wy * ux)
    T[0, 3] += step[3]
    T[1, 3] += step[4]
    T[2, 3] += step[5]
