"""Steps of the direction in which three points in a row are seen from a place."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit("float64(float64[:, ::1], float64[::1], float64[:, ::1], float64[::1])", cache=True)
def _look(triple, place, directions, distances):
    """Fill in the directions (3, 3) and distances (3,) of a triple, and return its two steps."""
    for j in range(3):
        x, y, z = (triple[j, 0] - place[0], triple[j, 1] - place[1], triple[j, 2] - place[2])
        distance = max(np.sqrt(x * x + y * y + z * z), 1e-9)
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
    return np.sqrt(first) + np.sqrt(second) + 1e-12


@njit("float64[:, ::1](float64[:, :, ::1], float64[:, ::1])", cache=True)
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
    out = np.empty((len(places), len(triples)))
    u, distances = np.empty((3, 3)), np.empty(3)
    for p in range(len(places)):
        for k in range(len(triples)):
            steps = _look(triples[k], places[p], u, distances)
            square = 0.0
            for a in range(3):
                square += (u[0, a] - 2 * u[1, a] + u[2, a]) ** 2
            out[p, k] = 2 * np.sqrt(square) / steps
    return out


@njit(
    "Tuple((float64[:, ::1], float64[::1]))(float64[:, :, ::1], float64[::1], float64)", cache=True
)
def step_equations(triples, place, scale):
    """Return the normal equations of sum_i r_i^2 / (r_i^2 + scale^2) over a motion of the place.

    Parameters
    ----------
    triples, place
        As `unequal_steps` takes them; one place (3,).
    scale
        Difference from which on a triple counts less and less.

    Returns
    -------
    H (3, 3) and g (3,); the step of the place solves H step = g.
    """
    H, g = np.zeros((3, 3)), np.zeros(3)
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
    return H, g
