"""Generated worlds and scanners: scans with an exact truth, for tests and calibration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

BLOCK = 4096
"""Rays that are cast at once."""


@dataclass(frozen=True)
class World:
    """Boxes that stand on the ground z = 0, in metres."""

    centres: Array
    """(K, 3) centres of the boxes."""
    sizes: Array
    """(K, 3) edges of the boxes."""
    yaws: Array
    """(K,) turns of the boxes about z, in radians."""
    has_ground: bool = True


@dataclass(frozen=True)
class Scan:
    """What a scanner at the origin of its own frame saw."""

    points: Array
    """(N, 3) points in the scanner's frame."""
    T_world_scan: Array
    """(4, 4) pose of the scanner."""


def cast(world: World, origin: Array, directions: Array) -> Array:
    """(N,) ranges of rays from the origin (3,) along unit directions (N, 3); infinite if none."""
    ranges = np.full(len(directions), np.inf)
    if world.has_ground:
        falling = directions[:, 2] < -1e-9
        ranges[falling] = -origin[2] / directions[falling, 2]
    cos, sin = np.cos(world.yaws), np.sin(world.yaws)
    axes = np.zeros((len(world.yaws), 3, 3))
    axes[:, 0, 0], axes[:, 0, 1], axes[:, 1, 0], axes[:, 1, 1] = cos, sin, -sin, cos
    axes[:, 2, 2] = 1
    local_origin = np.einsum("kij,kj->ki", axes, origin - world.centres)
    for first in range(0, len(directions), BLOCK):
        rays = directions[first : first + BLOCK]
        local = np.einsum("kij,nj->nki", axes, rays)
        with np.errstate(divide="ignore", invalid="ignore"):
            a = (-world.sizes / 2 - local_origin) / local
            b = (world.sizes / 2 - local_origin) / local
        near, far = np.fmin(a, b).max(axis=2), np.fmax(a, b).min(axis=2)
        hit = np.where((near < far) & (near > 1e-6), near, np.inf).min(axis=1)
        ranges[first : first + BLOCK] = np.minimum(ranges[first : first + BLOCK], hit)
    return ranges


def scan_world(
    world: World,
    position: Array,
    rng: np.random.Generator,
    *,
    yaw: float = 0.0,
    elevations_deg: tuple[float, float] = (-60.0, 40.0),
    rows: int = 120,
    columns: int = 360,
    noise: float = 0.01,
    max_range: float = 80.0,
) -> Scan:
    """Scan the world from a position (3,) with a levelled scanner turned by yaw (radians)."""
    azimuth = np.linspace(-np.pi, np.pi, columns, endpoint=False)
    elevation = np.radians(np.linspace(*elevations_deg, rows))
    az, el = (grid.ravel() for grid in np.meshgrid(azimuth, elevation))
    local = np.column_stack([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)])
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("z", yaw).as_matrix()
    T[:3, 3] = position
    ranges = cast(world, position, local @ T[:3, :3].T)
    seen = ranges < max_range
    measured = ranges[seen] + noise * rng.normal(size=int(seen.sum()))
    return Scan(local[seen] * measured[:, None], T)


def relative_pose(source: Scan, target: Scan) -> Array:
    """(4, 4) true T_target_source of two scans."""
    return np.linalg.inv(target.T_world_scan) @ source.T_world_scan


def street(rng: np.random.Generator, length: float = 80.0) -> World:
    """A street between house fronts of uneven depth, with parked cars, trees and bins."""
    centres, sizes, yaws = [], [], []

    def add(centre: tuple[float, float, float], size: tuple[float, float, float], yaw: float = 0):
        centres.append(centre)
        sizes.append(size)
        yaws.append(yaw)

    for side in (-1, 1):
        x = -length / 2
        while x < length / 2:
            width, height, setback = rng.uniform(6, 14), rng.uniform(5, 12), rng.uniform(0, 2.5)
            depth = 8.0
            add(
                (x + width / 2, side * (8 + setback + depth / 2), height / 2),
                (width, depth, height),
            )
            x += width + rng.choice([0.0, rng.uniform(1, 4)])
        for _ in range(10):
            at = rng.uniform(-length / 2, length / 2)
            add(
                (at, side * rng.uniform(4.2, 4.8), 0.75),
                (rng.uniform(3.6, 4.8), 1.8, 1.5),
                rng.normal(0, 0.03),
            )
        for _ in range(7):
            at, tall = rng.uniform(-length / 2, length / 2), rng.uniform(3, 7)
            add((at, side * rng.uniform(6.2, 7.2), tall / 2), (0.3, 0.3, tall), rng.uniform(0, 3))
    return World(np.array(centres), np.array(sizes), np.array(yaws))


def hall(rng: np.random.Generator, size: tuple[float, float, float] = (60, 30, 3.2)) -> World:
    """A hall with walls, a ceiling, pillars on a grid, and boxes that stand about."""
    x, y, z = size
    centres = [(0, s * (y / 2 + 0.1), z / 2) for s in (-1, 1)]
    sizes: list[tuple[float, float, float]] = [(x + 0.4, 0.2, z)] * 2
    centres += [(s * (x / 2 + 0.1), 0, z / 2) for s in (-1, 1)]
    sizes += [(0.2, y + 0.4, z)] * 2
    centres.append((0, 0, z + 0.1))
    sizes.append((x, y, 0.2))
    for px in np.arange(-x / 2 + 5, x / 2, 8):
        for py in (-y / 4, y / 4):
            centres.append((px, py, z / 2))
            sizes.append((0.4, 0.4, z))
    yaws = [0.0] * len(centres)
    for _ in range(24):
        s = rng.uniform((0.5, 0.5, 0.5), (4.0, 2.0, 2.2))
        centres.append((*rng.uniform((-x / 2 + 2, -y / 2 + 2), (x / 2 - 2, y / 2 - 2)), s[2] / 2))
        sizes.append(tuple(s))
        yaws.append(rng.uniform(0, np.pi))
    return World(np.array(centres), np.array(sizes), np.array(yaws))


ROOM = (6.0, 5.0, 2.6)
"""Length, width and height of a room of `rooms`."""


def rooms(rng: np.random.Generator, count: int) -> World:
    """Make a row of rooms along x, joined by doors, with boxes that stand about."""
    length, width, height = ROOM
    whole = count * length
    boxes = [((whole / 2, 0, height + 0.1), (whole + 0.4, width + 0.4, 0.2))]
    boxes += [
        ((whole / 2, s * (width / 2 + 0.1), height / 2), (whole, 0.2, height)) for s in (-1, 1)
    ]
    boxes += [((x, 0, height / 2), (0.2, width, height)) for x in (-0.1, whole + 0.1)]
    for x in length * np.arange(1, count):
        door = rng.uniform(1 - width / 2, width / 2 - 1)
        for low, high in ((-width / 2, door - 0.5), (door + 0.5, width / 2)):
            boxes.append(((x, (low + high) / 2, height / 2), (0.15, high - low, height)))
        boxes.append(((x, door, height - 0.3), (0.15, 1.0, 0.6)))
    fixed = len(boxes)
    for room in range(count):
        for _ in range(9):
            size = rng.uniform((0.3, 0.3, 0.3), (1.4, 0.8, 1.2))
            x, y = rng.uniform((0.6, 0.5 - width / 2), (length - 0.6, width / 2 - 0.5))
            boxes.append(((room * length + x, y, size[2] / 2), tuple(size)))
    centres, sizes = (np.array(each) for each in zip(*boxes, strict=True))
    yaws = np.concatenate([np.zeros(fixed), rng.uniform(0, np.pi, len(boxes) - fixed)])
    return World(centres, sizes, yaws)


@dataclass(frozen=True)
class MergedScan:
    """Scans of several stations in the frame of the world."""

    scans: tuple[Array, ...]
    """(N, 3) points of each station."""
    viewpoints: Array
    """(k, 3) places of the scanners."""

    @property
    def points(self) -> Array:
        """(N, 3) all points."""
        return np.concatenate(self.scans)


def scan_rooms(
    world: World, rng: np.random.Generator, numbers: Sequence[int], max_range: float = 80.0
) -> MergedScan:
    """Scan `rooms` of these numbers, each from a place over the boxes, and merge the scans."""
    length, width, _ = ROOM
    places, clouds = [], []
    for room in numbers:
        x, y = rng.uniform((1.0, 1.0 - width / 2), (length - 1.0, width / 2 - 1.0))
        place = np.array([room * length + x, y, 1.6])
        scan = scan_world(
            world, place, rng, elevations_deg=(-60.0, 60.0), columns=240, max_range=max_range
        )
        places.append(place)
        clouds.append(scan.points + place)
    return MergedScan(tuple(clouds), np.array(places))
