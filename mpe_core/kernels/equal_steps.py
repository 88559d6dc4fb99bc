"""Steps between points in a row, and those of the direction in which a place sees them."""

from __future__ import annotations

import numpy as np
from numba import float64, njit, types

from mpe_core.kernels.bounds import POINTS64

NEAREST = 1e-9
"""Least distance of a point from a place: one that lies there is seen in no direction."""
NO_STEP = 1e-12
"""What is added to the sum of two steps: three points may be seen in one direction."""


@njit(types.UniTuple(float64[::1], 2)(POINTS64), cache=True)
def step_lengths(points):
    """Measure the steps from each of the points (N, 3) to the next one.

    Returns
    -------
    (N - 1,) lengths of the steps, and (N - 2,) lengths of the differences of two that follow.
    """
    steps, changes = np.empty(len(points) - 1), np.empty(len(points) - 2)
    ux = uy = uz = 0.0
    for i in range(len(steps)):
        x = points[i + 1, 0] - points[i, 0]
        y = points[i + 1, 1] - points[i, 1]
        z = points[i + 1, 2] - points[i, 2]
        steps[i] = np.sqrt(x * x + y * y + z * z)
        if i > 0:
            changes[i - 1] = np.sqrt((x - ux) ** 2 + (y - uy) ** 2 + (z - uz) ** 2)
        ux, uy, uz = x, y, z
    return steps, changes


@njit(
    "void(float64[:, ::1], float64, float64, float64, float64[::1])",
    cache=True,
    error_model="numpy",
)
def _fill_unequal_steps(columns, px, py, pz, out):
    """Fill in the (K,) differences of the triples in the columns (9, K), seen from a place."""
    ax, ay, az = columns[0], columns[1], columns[2]
    bx, by, bz = columns[3], columns[4], columns[5]
    cx, cy, cz = columns[6], columns[7], columns[8]
    # unrolled and without a branch, so that the compiler turns it into vector instructions
    for k in range(out.shape[0]):
        x, y, z = ax[k] - px, ay[k] - py, az[k] - pz
        d = max(np.sqrt(x * x + y * y + z * z), NEAREST)
        ux, uy, uz = x / d, y / d, z / d
        x, y, z = bx[k] - px, by[k] - py, bz[k] - pz
        d = max(np.sqrt(x * x + y * y + z * z), NEAREST)
        vx, vy, vz = x / d, y / d, z / d
        x, y, z = cx[k] - px, cy[k] - py, cz[k] - pz
        d = max(np.sqrt(x * x + y * y + z * z), NEAREST)
        wx, wy, wz = x / d, y / d, z / d
        first = np.sqrt((vx - ux) ** 2 + (vy - uy) ** 2 + (vz - uz) ** 2)
        second = np.sqrt((wx - vx) ** 2 + (wy - vy) ** 2 + (wz - vz) ** 2)
        x, y, z = ux - 2 * vx + wx, uy - 2 * vy + wy, uz - 2 * vz + wz
        out[k] = 2 * np.sqrt(x * x + y * y + z * z) / (first + second + NO_STEP)


@njit("float64[:, ::1](float64[:, :, ::1], float64[:, ::1])", cache=True, error_model="numpy")
def unequal_steps(triples, places):
    """Return the difference of the two steps over their mean.

    Parameters
    ----------
    triples
        (K, 3, 3) points in a row.
    places
        (P, 3) places that see them.

    Returns
    -------
    (P, K) r_i = 2 |u_1 - 2 u_2 + u_3| / (|u_2 - u_1| + |u_3 - u_2|) of the directions u.
    """
    count = len(triples)
    columns = np.empty((9, count))
    for k in range(count):
        for j in range(3):
            for a in range(3):
                columns[3 * j + a, k] = triples[k, j, a]
    out = np.empty((len(places), count))
    for p in range(len(places)):
        _fill_unequal_steps(columns, places[p, 0], places[p, 1], places[p, 2], out[p])
    return out


@njit(
    "float64(float64[:, ::1], float64[::1], float64[:, ::1], float64[::1])",
    cache=True,
    error_model="numpy",
)
def _look(triple, place, directions, distances):
    """Fill in the directions (3, 3) and distances (3,) of a triple, and return its two steps."""
    for j in range(3):
        x, y, z = (triple[j, 0] - place[0], triple[j, 1] - place[1], triple[j, 2] - place[2])
        distance = max(np.sqrt(x * x + y * y + z * z), NEAREST)
        directions[j, 0], directions[j, 1], directions[j, 2] = (
            x / distance,
            y / distance,
            z / distance,
        )
        distances[j] = distance
    first = second = 0.0
    for a in range(3):
        first += (directions[1, a] - directions[0, a]) ** 2
        second += (directions[2, a] - directions[1, a]) ** 2
    return np.sqrt(first) + np.sqrt(second) + NO_STEP


@njit(
    "void(float64[:, :, ::1], float64[::1], float64, float64[:, ::1], float64[::1])",
    cache=True,
    error_model="numpy",
)
def _add_equations(triples, place, scale, H, g):
    """Add the normal equations of one place to H (3, 3) and g (3,)."""
    u, distances, J, r = np.empty((3, 3)), np.empty(3), np.empty((3, 3)), np.empty(3)
    for k in range(len(triples)):
        steps = _look(triples[k], place, u, distances)
        square = 0.0
        for a in range(3):
            r[a] = 2 * (u[0, a] - 2 * u[1, a] + u[2, a]) / steps
            square += r[a] ** 2
        weight = 1 / (1 + square / scale**2) ** 2
        J[:] = 0.0
        for j in range(3):
            # d u / d place = -(I - u u^T) / distance
            factor = (4.0 if j == 1 else -2.0) / (distances[j] * steps)
            for a in range(3):
                J[a, a] += factor
                for b in range(3):
                    J[a, b] -= factor * u[j, a] * u[j, b]
        for a in range(3):
            for i in range(3):
                g[i] -= weight * J[a, i] * r[a]
                for j in range(3):
                    H[i, j] += weight * J[a, i] * J[a, j]


@njit(
    "Tuple((float64[:, :, ::1], float64[:, ::1]))(float64[:, :, ::1], float64[:, ::1], float64)",
    cache=True,
    error_model="numpy",
)
def step_equations(triples, places, scale):
    """Return the normal equations of sum_i r_i^2 / (r_i^2 + scale^2) over a motion of each place.

    Parameters
    ----------
    triples, places
        As `unequal_steps` takes them.
    scale
        Difference from which on a triple counts less and less.

    Returns
    -------
    H (P, 3, 3) and g (P, 3); the step of a place solves H step = g.
    """
    H, g = np.zeros((len(places), 3, 3)), np.zeros((len(places), 3))
    for p in range(len(places)):
        _add_equations(triples, places[p], scale, H[p], g[p])
    return H, g
