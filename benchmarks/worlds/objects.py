"""Worlds of things: on a desk, a statue, a machine part, cartons."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.worlds.scanners import Scan, depth_frame, range_map
from benchmarks.worlds.scene import Scene

Rng = np.random.Generator


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


def cartons(world: Rng, scanner: Rng) -> tuple[Scene, Callable[[int], Scan]]:
    """Two range maps of two to four cartons on each other: smooth faces, a few straight edges."""
    scene, height = Scene(), 0.0
    for _ in range(int(world.integers(2, 5))):
        size = world.uniform((0.2, 0.15, 0.05), (0.5, 0.4, 0.25))
        at = (*world.uniform(-0.08, 0.08, 2), height + size[2] / 2)
        scene.box(at, tuple(size), float(world.choice([0.0, np.pi / 2, world.uniform(0, 3)])))
        height += size[2]
    start, turn = scanner.uniform(0, 2 * np.pi), np.radians(scanner.uniform(40, 120))
    views = [
        np.array([np.cos(a), np.sin(a), scanner.uniform(0.5, 1.2)]) for a in (start, start + turn)
    ]
    return scene, lambda k: range_map(scene, views[k] / np.linalg.norm(views[k]), scanner, 0.6)
