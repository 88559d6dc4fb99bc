"""Scanners: which rays they cast, and what noise and gaps their scans have."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks.worlds.scene import Scene

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Scan:
    """What one scanner measured."""

    points: Array
    """(N, 3) points in the scan's frame."""
    T_world_scan: Array
    """(4, 4) pose of this frame."""
    has_viewpoint: bool
    """Whether the scanner stood at the origin of the frame."""


def terrestrial(scene: Scene, position: Array, rng: np.random.Generator) -> Scan:
    """Scan all round from a tripod that stands level: 1.2 degrees a step, 3 mm of noise."""
    return _all_round(scene, position, rng, np.linspace(-60, 85, 122), 300, 0.003, 80.0)


def ring_lidar(scene: Scene, position: Array, rng: np.random.Generator, rings: int = 32) -> Scan:
    """Scan with a LiDAR on a car: rings from -25 to 8 degrees, 2 cm of noise."""
    return _all_round(scene, position, rng, np.linspace(-25, 8, rings), 900, 0.02, 70.0)


def _all_round(
    scene: Scene,
    position: Array,
    rng: np.random.Generator,
    elevations_deg: Array,
    columns: int,
    noise: float,
    max_range: float,
) -> Scan:
    az, el = np.meshgrid(
        np.linspace(-np.pi, np.pi, columns, endpoint=False), np.radians(elevations_deg)
    )
    local = _unit(az.ravel(), el.ravel())
    T = _pose(position, Rotation.from_euler("z", rng.uniform(0, 2 * np.pi)).as_matrix())
    return _measure(scene, local, T, rng, noise, max_range)


def depth_frame(
    scene: Scene, position: Array, look_at: Array, rng: np.random.Generator, max_range: float = 6.0
) -> Scan:
    """Take a depth image of 58 by 45 degrees; the noise grows with the square of the range."""
    u, v = np.meshgrid(np.linspace(-0.55, 0.55, 160), np.linspace(-0.41, 0.41, 120))
    local = np.column_stack([u.ravel(), v.ravel(), np.ones(u.size)])
    local /= np.linalg.norm(local, axis=1, keepdims=True)
    T = _pose(position, _looking(look_at - position, rng))
    return _measure(scene, local, T, rng, 0.0015, max_range, grows=True)


def range_map(scene: Scene, direction: Array, rng: np.random.Generator, extent: float) -> Scan:
    """Take a range map along parallel rays against the direction, 0.1 mm of noise a metre."""
    side = np.linspace(-extent, extent, 140)
    u, v = (grid.ravel() for grid in np.meshgrid(side, side))
    R = _looking(-direction, rng)
    origins = -3 * extent * R[:, 2] + u[:, None] * R[:, 0] + v[:, None] * R[:, 1]
    ranges = scene.cast(origins, np.broadcast_to(R[:, 2], origins.shape))
    seen = np.isfinite(ranges)
    measured = ranges[seen] + 5e-4 * extent * rng.normal(size=int(seen.sum()))
    world = origins[seen] + measured[:, None] * R[:, 2]
    T = _pose(world.mean(axis=0), R)
    return Scan((world - T[:3, 3]) @ R, T, has_viewpoint=False)


def airborne(
    scene: Scene, centre: Array, half: tuple[float, float], rng: np.random.Generator
) -> Scan:
    """Scan a rectangle from a strip flown 800 m above, up to 20 degrees off the vertical."""
    n = int(np.clip(4 * half[0] * half[1] * 2.0, 4000, 60_000))
    foot = rng.uniform((-half[0], -half[1]), half, (n, 2)) + centre[:2]
    offset = rng.uniform(-250, 250)  # the flight line beside the rectangle, along y
    origins = np.column_stack([np.full(n, centre[0] + offset), foot[:, 1], np.full(n, 800.0)])
    rays = np.column_stack([foot, np.zeros(n)]) - origins
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    ranges = scene.cast(origins, rays)
    seen = np.isfinite(ranges)
    world = origins[seen] + ranges[seen, None] * rays[seen]
    world += rng.normal(0, (0.05, 0.05, 0.03), world.shape)
    T = _pose(np.array([*centre[:2], 0.0]), np.eye(3))
    return Scan(world - T[:3, 3], T, has_viewpoint=False)


def fused(scans: list[Scan], warp: float, rng: np.random.Generator) -> Scan:
    """Join scans into a fragment that bends smoothly by up to this share of its size."""
    T = scans[len(scans) // 2].T_world_scan
    to_frame = np.linalg.inv(T)
    points = np.vstack(
        [
            each.points @ (to_frame @ each.T_world_scan)[:3, :3].T
            + (to_frame @ each.T_world_scan)[:3, 3]
            for each in scans
        ]
    )
    size = np.linalg.norm(points - points.mean(axis=0), axis=1).max()
    waves, phases = rng.normal(0, 1.5 / size, (3, 3, 3)), rng.uniform(0, 2 * np.pi, (3, 3))
    bend = np.sin(np.einsum("kij,nj->nki", waves, points) + phases).mean(axis=1)
    return Scan(points + warp * size * bend, T, has_viewpoint=False)


def _measure(
    scene: Scene,
    local: Array,
    T: Array,
    rng: np.random.Generator,
    noise: float,
    max_range: float,
    *,
    grows: bool = False,
) -> Scan:
    """Cast the rays (N, 3) of the scanner's frame; two in a hundred return nothing."""
    ranges = scene.cast(T[:3, 3], local @ T[:3, :3].T)
    seen = (ranges < max_range) & (rng.uniform(size=len(ranges)) > 0.02)
    r = ranges[seen]
    r = r + noise * (r**2 if grows else 1.0) * rng.normal(size=len(r))
    return Scan(local[seen] * r[:, None], T, has_viewpoint=True)


def _unit(azimuth: Array, elevation: Array) -> Array:
    cos = np.cos(elevation)
    return np.column_stack([cos * np.cos(azimuth), cos * np.sin(azimuth), np.sin(elevation)])


def _looking(direction: Array, rng: np.random.Generator) -> Array:
    """(3, 3) rotation whose z axis looks along the direction, with y down but for some roll."""
    z = direction / np.linalg.norm(direction)
    down = np.array([0.05, 0.02, -1.0]) if abs(z[2]) < 0.95 else np.array([1.0, 0, 0])
    x = np.cross(down, z)
    x /= np.linalg.norm(x)
    R = np.column_stack([x, np.cross(z, x), z])
    return R @ Rotation.from_euler("z", rng.normal(0, 0.1)).as_matrix()


def _pose(position: Array, R: Array) -> Array:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, position
    return T
