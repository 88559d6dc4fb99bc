"""Families of worlds: each makes a scene and scans it from two places.

A family takes a generator of the scene and one of the scanners: pairs of the same scene have the
first in common, pairs of two scenes of one kind, which no pose registers, do not.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from benchmarks.worlds.scanners import (
    Scan,
    airborne,
    depth_frame,
    fused,
    range_map,
    ring_lidar,
    terrestrial,
)
from benchmarks.worlds.scene import Scene, ground_height

Array = NDArray[np.float64]
Rng = np.random.Generator
Family = Callable[[Rng, Rng], tuple[Scene, Callable[[int], Scan]]]


def _street(rng: Rng, length: float = 90.0) -> Scene:
    scene = Scene()
    scene.box((0, 0, -0.05), (2 * length, 120, 0.1))
    for side in (-1, 1):
        x, bay = -length, rng.uniform(3, 5)
        while x < length:
            bays = int(rng.integers(2, 5))
            height, setback = rng.uniform(6, 16), rng.uniform(0, 2)
            face = side * (8.5 + setback)
            scene.box((x + bays * bay / 2, face + side * 5, height / 2), (bays * bay, 10, height))
            for k in range(bays):  # doors and windows repeat
                for floor in range(int(height // 3)):
                    at = (x + (k + 0.5) * bay, face - side * 0.1, 3 * floor + 1.6)
                    scene.box(at, (bay * 0.5, 0.5, 1.4))
            x += bays * bay + float(rng.choice([0.0, 3.0]))
        for _ in range(14):
            at, tall = rng.uniform(-length, length), rng.uniform(1.4, 2.2)
            scene.box((at, side * 5.2, tall / 2), (rng.uniform(3.6, 5.5), 1.8, tall))
        for _ in range(10):
            at, tall = rng.uniform(-length, length), rng.uniform(2.0, 4.0)
            scene.cylinder((at, side * 7, 0), rng.uniform(0.1, 0.25), tall + 1)
            if rng.uniform() < 0.6:
                scene.blob((at, side * 7, tall + 2), (1.5, 1.5, 1.8), rng, 0.6)
    return scene


def street_stations(world: Rng, scanner: Rng) -> tuple[Scene, Callable[[int], Scan]]:
    """Two stations of a terrestrial scanner in a street."""
    step = scanner.uniform(8, 45)
    places = [np.array([s * step / 2, scanner.uniform(-3, 3), 1.7]) for s in (-1, 1)]
    scene = _street(world)
    return scene, lambda k: terrestrial(scene, places[k], scanner)


def street_drive(world: Rng, scanner: Rng) -> tuple[Scene, Callable[[int], Scan]]:
    """Two turns of a LiDAR with 16 to 64 rings on a car."""
    step, rings = scanner.uniform(3, 25), int(scanner.choice([16, 32, 64]))
    places = [np.array([s * step / 2, scanner.uniform(-2, 2), 1.8]) for s in (-1, 1)]
    scene = _street(world)
    return scene, lambda k: ring_lidar(scene, places[k], scanner, rings)


def _rooms(rng: Rng) -> Scene:
    """Make a flat of four rooms, 10 by 8 metres, with doors and furniture."""
    scene = Scene()
    scene.box((0, 0, -0.05), (10.4, 8.4, 0.1))
    scene.box((0, 0, 2.65), (10.4, 8.4, 0.1))
    for s in (-1, 1):
        scene.box((s * 5.1, 0, 1.3), (0.2, 8.4, 2.6))
        scene.box((0, s * 4.1, 1.3), (10.4, 0.2, 2.6))
    wall_x, wall_y = rng.uniform(-1.5, 1.5), rng.uniform(-1, 1)
    for low, high in ((-4.0, wall_y), (wall_y, 4.0)):
        door = rng.uniform(low + 0.8, high - 0.8)
        for a, b in ((low, door - 0.5), (door + 0.5, high)):
            scene.box((wall_x, (a + b) / 2, 1.3), (0.12, b - a, 2.6))
    for low, high in ((-5.0, wall_x), (wall_x, 5.0)):
        door = rng.uniform(low + 0.8, high - 0.8)
        for a, b in ((low, door - 0.5), (door + 0.5, high)):
            scene.box(((a + b) / 2, wall_y, 1.3), (b - a, 0.12, 2.6))
    for _ in range(26):
        size = rng.uniform((0.3, 0.3, 0.3), (1.8, 0.9, 1.9))
        x, y = rng.uniform((-4.6, -3.6), (4.6, 3.6))
        if abs(x - wall_x) > 0.6 and abs(y - wall_y) > 0.6:
            scene.box(
                (x, y, size[2] / 2),
                tuple(size),
                float(rng.choice([0, np.pi / 2, rng.uniform(0, 3)])),
            )
    for _ in range(14):
        x, y = rng.uniform((-4.6, -3.6), (4.6, 3.6))
        r = rng.uniform(0.08, 0.3)
        scene.blob((x, y, rng.uniform(0.1, 1.2)), (r, r, 1.4 * r), rng, 0.5)
    return scene


def room_stations(world: Rng, scanner: Rng) -> tuple[Scene, Callable[[int], Scan]]:
    """Two stations of a terrestrial scanner in one room of a flat or in two."""
    places = [np.array([*scanner.uniform((-4, -3), (4, 3)), 1.5]) for _ in range(2)]
    scene = _rooms(world)
    return scene, lambda k: terrestrial(scene, places[k], scanner)


def room_frames(world: Rng, scanner: Rng) -> tuple[Scene, Callable[[int], Scan]]:
    """Two depth images of a room."""
    eye = np.array([*scanner.uniform((-3, -2), (3, 2)), 1.4])
    aim = np.array([*scanner.uniform((-4.8, -3.8), (4.8, 3.8)), 0.9])
    eyes = [eye, eye + scanner.normal(0, (0.5, 0.5, 0.15))]
    aims = [aim, aim + scanner.normal(0, (0.7, 0.7, 0.2))]
    scene = _rooms(world)
    return scene, lambda k: depth_frame(scene, eyes[k], aims[k], scanner)


def room_fragments(world: Rng, scanner: Rng) -> tuple[Scene, Callable[[int], Scan]]:
    """Two fragments of a room, each fused from ten depth images, that bend by 0.2 to 0.6 %."""
    eye = np.array([*scanner.uniform((-2, -1.5), (2, 1.5)), 1.4])
    start, step = scanner.uniform(0, 2 * np.pi), scanner.uniform(0.4, 1.1)
    warp = scanner.uniform(0.002, 0.006)
    scene = _rooms(world)

    def fragment(k: int) -> Scan:
        frames = []
        for angle in start + k * step + np.linspace(0, 1.0, 10):
            at = eye + scanner.normal(0, (0.25, 0.25, 0.1))
            aim = at + np.array([np.cos(angle), np.sin(angle), scanner.normal(-0.2, 0.15)])
            frames.append(depth_frame(scene, at, aim, scanner, 4.5))
        return fused(frames, warp, scanner)

    return scene, fragment


def corridor(world: Rng, scanner: Rng) -> tuple[Scene, Callable[[int], Scan]]:
    """Two stations in a corridor with doors at equal distances and few other things."""
    scene, length, wide = Scene(), 40.0, world.uniform(1.8, 3.0)
    scene.box((0, 0, -0.05), (2 * length, wide + 2, 0.1))
    scene.box((0, 0, 2.75), (2 * length, wide + 2, 0.1))
    bay = world.uniform(3, 5)
    for side in (-1, 1):
        scene.box((0, side * (wide / 2 + 0.3), 1.35), (2 * length, 0.3, 2.7))
        for x in np.arange(-length, length, bay):
            if world.uniform() < 0.8:
                scene.box((x, side * (wide / 2 + 0.1), 1.05), (0.95, 0.2, 2.1))
        for _ in range(30):
            size = world.uniform((0.3, 0.2, 0.4), (1.6, 0.6, 1.9))
            at = (world.uniform(-length, length), side * (wide / 2 - size[1] / 2), size[2] / 2)
            scene.box(at, tuple(size))
    for x in np.arange(-length, length, 2 * bay):  # beams and lamps
        if world.uniform() < 0.5:
            scene.box((x + world.uniform(0, bay), 0, 2.55), (world.uniform(0.2, 1.2), wide, 0.3))
    step = scanner.uniform(3, 14)
    places = [np.array([s * step / 2, scanner.uniform(-0.5, 0.5), 1.5]) for s in (-1, 1)]
    return scene, lambda k: terrestrial(scene, places[k], scanner)


def stairwell(world: Rng, scanner: Rng) -> tuple[Scene, Callable[[int], Scan]]:
    """Two stations on a flight of stairs or the landings at its ends."""
    scene = Scene()
    wide, rise, run = world.uniform(1.1, 1.6), world.uniform(0.16, 0.19), world.uniform(0.26, 0.3)
    steps = 10
    flight, landing = steps * run, 1.4
    for floor in range(3):
        base = floor * 2 * steps * rise
        for k in range(steps):
            scene.box((k * run, -wide / 2, base + (k + 0.5) * rise), (run, wide, rise))
            scene.box(
                (flight - k * run, wide / 2, base + (steps + k + 0.5) * rise), (run, wide, rise)
            )
        scene.box((flight + landing / 2, 0, base + steps * rise), (landing, 2 * wide, 0.15))
        scene.box((-landing / 2, 0, base + 2 * steps * rise), (landing, 2 * wide, 0.15))
        scene.box(
            (flight + landing, world.uniform(-0.5, 0.5), base + steps * rise + 1.4), (0.2, 0.9, 1.0)
        )
    scene.box((flight / 2, 0, -0.05), (flight + 2 * landing, 2 * wide, 0.1))
    height = 6 * steps * rise
    for s in (-1, 1):
        scene.box((flight / 2, s * (wide + 0.1), height / 2), (flight + 2 * landing, 0.2, height))
    for x in (-landing - 0.1, flight + landing + 0.1):
        scene.box((x, 0, height / 2), (0.2, 2 * wide, height))
    for _ in range(16):
        x = float(world.choice([-landing / 2, flight + landing / 2]))
        level = steps * rise * (float(world.choice([0, 2, 4])) + (0 if x < 0 else 1))
        at = (x + world.uniform(-0.5, 0.5), world.uniform(-wide, wide), level + 0.35)
        scene.box(at, tuple(world.uniform(0.15, 0.6, 3)), world.uniform(0, 3))
    # along the first flight, 1.4 m over its steps
    along = np.sort(scanner.uniform(-landing / 2, flight + landing / 2, 2))
    places = [
        np.array(
            [
                x,
                -wide / 2 + scanner.uniform(-0.2, 0.2),
                float(np.clip(x / flight, 0, 1)) * steps * rise + 1.4,
            ]
        )
        for x in along
    ]
    return scene, lambda k: terrestrial(scene, places[k], scanner)


def forest(world: Rng, scanner: Rng) -> tuple[Scene, Callable[[int], Scan]]:
    """Two stations among trees on rolling ground."""
    scene, extent, relief = Scene(), 45.0, world.uniform(1, 5)
    seed = int(world.integers(1 << 30))
    scene.terrain(extent, relief, np.random.default_rng(seed))
    feet = world.uniform(-extent + 1, extent - 1, (260, 2))
    heights = ground_height(feet[:, 0], feet[:, 1], relief, np.random.default_rng(seed))
    for (x, y), z in zip(feet, heights, strict=True):
        tall, radius = world.uniform(6, 14), world.uniform(0.08, 0.3)
        lean = (*world.normal(0, 0.05, 2), 0.0)
        scene.cylinder((x, y, z - 0.2), radius, tall, lean)
        if world.uniform() < 0.7:
            scene.blob((x, y, z + tall), (1.6, 1.6, 2.4), world, 0.8)
        if world.uniform() < 0.3:
            scene.blob((x + 1, y, z + 0.3), tuple(world.uniform(0.2, 0.7, 3)), world, 0.8)
    step = scanner.uniform(4, 16)
    places = []
    for s in (-1, 1):
        x, y = s * step / 2, scanner.uniform(-2, 2)
        z = ground_height(np.array(x), np.array(y), relief, np.random.default_rng(seed))
        places.append(np.array([x, y, float(z) + 1.6]))
    return scene, lambda k: terrestrial(scene, places[k], scanner)


def airborne_town(world: Rng, scanner: Rng) -> tuple[Scene, Callable[[int], Scan]]:
    """Two strips over a town: houses with gabled or flat roofs, trees."""
    scene, extent, relief = Scene(), 180.0, world.uniform(0, 4)
    seed = int(world.integers(1 << 30))
    scene.terrain(extent, relief, np.random.default_rng(seed))
    heading = world.uniform(0, np.pi)
    for _ in range(230):
        x, y = world.uniform(-extent + 10, extent - 10, 2)
        z = float(ground_height(np.array(x), np.array(y), relief, np.random.default_rng(seed)))
        size = world.uniform((8, 6, 4), (22, 12, 14))
        yaw = heading + float(world.choice([0, np.pi / 2])) + world.normal(0, 0.05)
        scene.box((x, y, z + size[2] / 2 - 1), tuple(size), yaw)
        if world.uniform() < 0.7:
            gable = min(size[:2]) / np.sqrt(2)
            ridge = (size[0], gable, gable)
            # a box on its edge, along the house
            scene_roof(scene, (x, y, z + size[2] - 1), ridge, yaw)
    for _ in range(250):
        x, y = world.uniform(-extent + 5, extent - 5, 2)
        z = float(ground_height(np.array(x), np.array(y), relief, np.random.default_rng(seed)))
        r = world.uniform(1.5, 4)
        scene.blob((x, y, z + 1.5 * r), (r, r, 1.4 * r), world, 0.5)
    half = scanner.uniform((35, 45), (60, 90))
    shift = scanner.uniform((0.2, 0.0), (1.6, 0.8)) * half
    centres = [np.array([*(s * shift / 2), 0.0]) for s in (-1, 1)]
    return scene, lambda k: airborne(scene, centres[k], (float(half[0]), float(half[1])), scanner)


def scene_roof(
    scene: Scene,
    centre: tuple[float, float, float],
    size: Array | tuple[float, float, float],
    yaw: float,
) -> None:
    """Add a gabled roof: the upper half of a square prism on its edge."""
    half_length, half_width = size[0] / 2, size[1] / np.sqrt(2)
    c, s = np.cos(yaw), np.sin(yaw)
    along = np.array([[-half_length, half_length]] * 3)
    across = np.array([[-half_width] * 2, [0.0] * 2, [half_width] * 2])
    z = np.array([[0.0] * 2, [0.6 * half_width] * 2, [0.0] * 2])
    scene.surface(
        centre[0] + c * along - s * across, centre[1] + s * along + c * across, centre[2] + z
    )


def desk(world: Rng, scanner: Rng) -> tuple[Scene, Callable[[int], Scan]]:
    """Two depth images of a desk full of things, before a wall."""
    scene = Scene()
    scene.box((0, 0, -0.02), (1.8, 0.9, 0.04))
    scene.box((0, 0.6, 0.3), (3.0, 0.04, 2.0))
    for _ in range(16):
        size = world.uniform((0.03, 0.03, 0.03), (0.25, 0.2, 0.3))
        at = (*world.uniform((-0.8, -0.35), (0.8, 0.35)), size[2] / 2)
        scene.box(at, tuple(size), world.uniform(0, 3))
    for _ in range(12):
        x, y = world.uniform((-0.8, -0.35), (0.8, 0.35))
        if world.uniform() < 0.5:
            scene.cylinder((x, y, 0), world.uniform(0.02, 0.06), world.uniform(0.08, 0.25))
        else:
            r = world.uniform(0.03, 0.08)
            scene.blob((x, y, r), (r, 1.3 * r, r), world, 0.5)
    turn = scanner.uniform(0.1, 0.9)
    eyes = [
        np.array([1.1 * np.sin(a), -1.1 * np.cos(a), scanner.uniform(0.5, 0.8)])
        for a in scanner.uniform(-0.5, 0.5) + np.array([-turn / 2, turn / 2])
    ]
    aims = [scanner.normal(0, (0.2, 0.08, 0.04)) for _ in range(2)]
    return scene, lambda k: depth_frame(scene, eyes[k], aims[k], scanner, 2.5)


def statue(world: Rng, scanner: Rng) -> tuple[Scene, Callable[[int], Scan]]:
    """Two range maps of a figure of many rounded bodies."""
    scene = Scene()
    scene.blob((0, 0, 0), (0.25, 0.2, 0.4), world, 0.3)
    for _ in range(14):
        at = world.normal(0, (0.16, 0.13, 0.3))
        scene.blob(tuple(at), tuple(world.uniform(0.05, 0.16, 3)), world, 0.4)
    for _ in range(30):
        at = world.normal(0, (0.2, 0.17, 0.3))
        scene.blob(tuple(at), tuple(world.uniform(0.02, 0.05, 3)), world, 0.4)
    first = scanner.normal(size=3)
    first /= np.linalg.norm(first)
    axis = np.cross(first, scanner.normal(size=3))
    axis /= np.linalg.norm(axis)
    angle = np.radians(scanner.uniform(25, 95))
    second = first * np.cos(angle) + np.cross(axis, first) * np.sin(angle)
    views = [first, second]
    return scene, lambda k: range_map(scene, views[k], scanner, 0.7)


def machine_part(world: Rng, scanner: Rng) -> tuple[Scene, Callable[[int], Scan]]:
    """Two range maps of a part of plates, ribs and bosses at right angles."""
    scene = Scene()
    scene.box((0, 0, 0), (0.8, 0.5, 0.1))
    scene.box((-0.35, 0, 0.2), (0.1, 0.5, 0.4))
    for _ in range(9):
        size = world.uniform((0.04, 0.04, 0.05), (0.25, 0.2, 0.25))
        scene.box((*world.uniform((-0.35, -0.2), (0.35, 0.2)), 0.05 + size[2] / 2), tuple(size))
    for _ in range(6):
        at = (*world.uniform((-0.35, -0.2), (0.35, 0.2)), 0.05)
        scene.cylinder(at, world.uniform(0.02, 0.06), world.uniform(0.03, 0.25))
    first = np.array([*scanner.normal(0, 0.7, 2), 1.0])
    second = first + scanner.normal(0, 0.7, 3)
    views = [first / np.linalg.norm(first), second / np.linalg.norm(second)]
    return scene, lambda k: range_map(scene, views[k], scanner, 0.6)


FAMILIES: dict[str, Family] = {
    "street_stations": street_stations,
    "street_drive": street_drive,
    "room_stations": room_stations,
    "room_frames": room_frames,
    "room_fragments": room_fragments,
    "corridor": corridor,
    "stairwell": stairwell,
    "forest": forest,
    "airborne_town": airborne_town,
    "desk": desk,
    "statue": statue,
    "machine_part": machine_part,
}
"""Families of worlds by name."""
