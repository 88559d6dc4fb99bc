"""Worlds indoors: rooms, a corridor, a stairwell."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.worlds.scanners import Scan, depth_frame, fused, terrestrial
from benchmarks.worlds.scene import Scene

Rng = np.random.Generator


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


def bare_room(world: Rng, scanner: Rng) -> tuple[Scene, Callable[[int], Scan]]:
    """Two depth images of a room with few things, from two neighbouring corners."""
    x, y, z = *world.uniform(3, 7, 2), 2.7
    scene = Scene()
    for height in (-0.05, z + 0.05):
        scene.box((0, 0, height), (x + 0.4, y + 0.4, 0.1))
    for s in (-1, 1):
        scene.box((s * (x / 2 + 0.1), 0, z / 2), (0.2, y + 0.4, z))
        scene.box((0, s * (y / 2 + 0.1), z / 2), (x + 0.4, 0.2, z))
    for _ in range(int(world.integers(4, 10))):
        size = world.uniform(0.3, 1.2, 3)
        at = (world.uniform(-0.5, 0.5) * (x - 1.4), world.uniform(-0.5, 0.5) * (y - 1.4))
        scene.box((*at, size[2] / 2), tuple(size), world.uniform(0, 3))
    eyes = [
        np.array([s * (x / 2 - 0.25), 0.25 - y / 2, scanner.uniform(1.3, 1.8)]) for s in (-1, 1)
    ]
    aims = [scanner.normal((0, 0.1 * y, 0.8), 0.3) for _ in eyes]
    return scene, lambda k: depth_frame(scene, eyes[k], aims[k], scanner, 9.0)
