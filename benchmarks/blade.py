"""A parametric turbine blade and a simulated laser scanner; millimeters."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mesh = tuple[Array, NDArray[np.int32]]

SPAN = 100.0
ROOT_CHORD, TIP_CHORD = 52.0, 34.0
ROOT_PITCH, TIP_PITCH = np.radians(15), np.radians(55)  # the twist is the difference
THICKNESS, CAMBER, CAMBER_PLACE = 0.12, 0.09, 0.42  # of the chord: a NACA 9412
LEAN, SWEEP = 6.0, 10.0  # of the tip against the root
PLATFORM = (-30.0, 30.0, -22.0, 22.0, -7.0, 0.5)
DOVETAIL = [(-9, -7), (-6, -13), (-12, -22), (12, -22), (6, -13), (9, -7)]  # y, z of its section

STAND_OFF = 400.0
FIELD = np.radians(19)
PIXELS = 280
NOISE = 0.04  # standard deviation along the ray
STRAY_SHARE = 0.02  # share of the points


def blade() -> list[Mesh]:
    """Return closed meshes of airfoil, platform and dovetail: vertices (V, 3), triangles (T, 3)."""
    x0, x1, y0, y1, z0, z1 = PLATFORM
    platform = np.array([(y0, z0), (y1, z0), (y1, z1), (y0, z1)])
    dovetail = np.array(DOVETAIL, float)
    return [
        _airfoil(sections=60, points=80),
        _prism(platform, x0, x1),
        _prism(dovetail, 0.8 * x0, 0.8 * x1),
    ]


def scan(azimuth: float, elevation: float, roll: float, seed: int) -> tuple[Array, Array]:
    """Scan the blade from a direction given in radians.

    Returns
    -------
    Points (N, 3) in the scanner's frame, and the pose (4, 4) T_scanner_blade; the scanner's frame
    has x right, y down and z along its view.
    """
    import open3d as o3d

    scene = o3d.t.geometry.RaycastingScene()
    for vertices, triangles in blade():
        scene.add_triangles(vertices.astype(np.float32), triangles.astype(np.uint32))
    T_scanner_blade = _pose(azimuth, elevation, roll)
    R, t = T_scanner_blade[:3, :3], T_scanner_blade[:3, 3]
    directions = _pixels()
    rays = np.hstack([np.broadcast_to(-R.T @ t, directions.shape), directions @ R])
    distance = scene.cast_rays(rays.astype(np.float32))["t_hit"].numpy().astype(float)
    seen = np.isfinite(distance)
    rng = np.random.default_rng(seed)
    noisy = distance[seen] + rng.normal(0, NOISE, seen.sum())
    points = directions[seen] * noisy[:, None]
    low, high = points.min(axis=0), points.max(axis=0)
    strays = rng.uniform(low, high, (int(STRAY_SHARE * len(points)), 3))
    return rng.permutation(np.vstack([points, strays])), T_scanner_blade


def _pixels() -> Array:
    """Return the unit directions of the scanner's rays in its frame."""
    side = np.tan(FIELD / 2) * np.linspace(-1, 1, PIXELS)
    right, down = np.meshgrid(side, side)
    rays = np.stack([right.ravel(), down.ravel(), np.ones(PIXELS**2)], axis=1)
    return rays / np.linalg.norm(rays, axis=1, keepdims=True)


def _pose(azimuth: float, elevation: float, roll: float) -> Array:
    center = np.array([0.0, 0.0, 0.38 * SPAN])
    view = -np.array(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ]
    )
    right = np.cross(view, [0, 0, 1])
    right /= np.linalg.norm(right)
    down = np.cross(view, right)
    c, s = np.cos(roll), np.sin(roll)
    R = np.stack([c * right + s * down, c * down - s * right, view])
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, R @ (view * STAND_OFF - center)
    return T


def _section(points: int) -> Array:
    """Return the outline (2 points, 2) of a NACA 4-digit airfoil of chord 1.

    It runs from the tail over the upper side to the tail again (Abbott and von Doenhoff, Theory of
    Wing Sections, ch. 6).
    """
    x = (1 - np.cos(np.linspace(0, np.pi, points))) / 2
    polynomial = 0.2969 * np.sqrt(x) - 0.126 * x - 0.3516 * x**2 + 0.2843 * x**3 - 0.1036 * x**4
    half = 5 * THICKNESS * polynomial
    m, p = CAMBER, CAMBER_PLACE
    front = x < p
    line = np.where(
        front, m / p**2 * (2 * p * x - x**2), m / (1 - p) ** 2 * (1 - 2 * p + 2 * p * x - x**2)
    )
    slope = np.arctan(np.where(front, 2 * m / p**2, 2 * m / (1 - p) ** 2) * (p - x))
    upper = np.stack([x - half * np.sin(slope), line + half * np.cos(slope)], axis=1)
    lower = np.stack([x + half * np.sin(slope), line - half * np.cos(slope)], axis=1)
    return np.vstack([upper[::-1], lower]) - [0.4, 0.0]


def _airfoil(sections: int, points: int) -> Mesh:
    outline = _section(points)
    rings = []
    for s in np.linspace(0, 1, sections):
        chord = ROOT_CHORD + s * (TIP_CHORD - ROOT_CHORD)
        pitch = ROOT_PITCH + s * (TIP_PITCH - ROOT_PITCH)
        turn = np.array([[np.cos(pitch), -np.sin(pitch)], [np.sin(pitch), np.cos(pitch)]])
        flat = chord * outline @ turn.T + [SWEEP * s**2, LEAN * s**2]
        rings.append(np.column_stack([flat, np.full(len(flat), SPAN * s)]))
    return _skin(np.array(rings))


def _prism(section: Array, x0: float, x1: float) -> Mesh:
    """Extrude a section in the y, z plane from x0 to x1."""
    return _skin(np.array([np.insert(section, 0, x, axis=1) for x in (x0, x1)]))


def _skin(rings: Array) -> Mesh:
    """Return the triangles between neighboring rings (S, P, 3), and a fan at each end."""
    count, size, _ = rings.shape
    i, j = np.meshgrid(np.arange(count - 1), np.arange(size), indexing="ij")
    a, b = i * size + j, i * size + (j + 1) % size
    sides = np.concatenate([np.stack([a, b, b + size], -1), np.stack([a, b + size, a + size], -1)])
    k = np.arange(size)
    ends = [
        np.stack([np.full(size, count * size + e), first + k, first + (k + 1) % size], axis=1)
        for e, first in enumerate((0, (count - 1) * size))
    ]
    centers = rings[[0, -1]].mean(axis=1)
    vertices = np.vstack([rings.reshape(-1, 3), centers])
    return vertices, np.vstack([sides.reshape(-1, 3), *ends]).astype(np.int32)
