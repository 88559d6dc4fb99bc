"""Spheres through four points, and the points that lie on them."""

from __future__ import annotations

import numpy as np
from numba import njit

MIN_DETERMINANT = 1e-9
"""Determinant of the sides of four points over the cube of the longest coordinate up to which they
count as lying in a plane, through which there is no sphere."""


@njit("float64(float64[:, ::1], float64[::1])", cache=True, error_model="numpy")
def sphere_through(corners, center):
    """Find the sphere through four points (4, 3).

    Parameters
    ----------
    corners
        The points.
    center
        (3,) takes the center.

    Returns
    -------
    The radius; infinite where the points lie in a plane.
    """
    A, b = np.empty((3, 3)), np.zeros(3)
    longest = 0.0
    for r in range(3):
        for a in range(3):
            A[r, a] = corners[r + 1, a] - corners[0, a]
            longest = max(longest, abs(A[r, a]))
            b[r] += 0.5 * A[r, a] * A[r, a]
    # the center is as far from each corner as from the first: A (center - first) = |A|^2 / 2
    det = 0.0
    for a in range(3):
        s, t = (a + 1) % 3, (a + 2) % 3
        det += A[0, a] * (A[1, s] * A[2, t] - A[1, t] * A[2, s])
    if abs(det) <= MIN_DETERMINANT * longest**3:
        return np.inf
    square = 0.0
    for a in range(3):
        s, t = (a + 1) % 3, (a + 2) % 3
        offset = b[0] * (A[1, s] * A[2, t] - A[1, t] * A[2, s])
        offset += b[1] * (A[2, s] * A[0, t] - A[2, t] * A[0, s])
        offset += b[2] * (A[0, s] * A[1, t] - A[0, t] * A[1, s])
        offset /= det
        center[a] = corners[0, a] + offset
        square += offset * offset
    return np.sqrt(square)


@njit(
    "Tuple((float64[::1], int64))(float64[:, :, ::1], float64[:, ::1], float64, float64)",
    cache=True,
    error_model="numpy",
)
def fullest_sphere(corners, points, tolerance, max_radius):
    """Find the sphere that holds the most of the points.

    Parameters
    ----------
    corners
        (K, 4, 3) points, through each four of which there is a sphere.
    points
        (N, 3) points that are counted.
    tolerance
        Deviation of a point from the radius over the radius up to which it lies on the sphere.
    max_radius
        Largest radius of a sphere that is looked at.

    Returns
    -------
    (3,) its center, and the number of points on it.
    """
    center, best = np.zeros(3), np.zeros(3)
    most = 0
    for k in range(corners.shape[0]):
        radius = sphere_through(corners[k], center)
        if not radius <= max_radius:
            continue
        low, high = ((1.0 - tolerance) * radius) ** 2, ((1.0 + tolerance) * radius) ** 2
        count = 0
        for i in range(points.shape[0]):
            dx, dy, dz = (
                points[i, 0] - center[0],
                points[i, 1] - center[1],
                points[i, 2] - center[2],
            )
            square = dx * dx + dy * dy + dz * dz
            count += 1 if low <= square <= high else 0
        if count > most:
            most = count
            best[:] = center
    return best, most
