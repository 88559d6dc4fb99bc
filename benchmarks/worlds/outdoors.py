"""Worlds outdoors: streets, a forest, a town from above."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from benchmarks.worlds.scanners import Scan, airborne, ring_lidar, terrestrial
from benchmarks.worlds.scene import Scene, ground_height

Array = NDArray[np.float64]
Rng = np.random.Generator


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
