"""Values that stand for no measurement, and uneven density."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.kinds.case import Array, Case, Maker, body
from service.formats import read_surface, write_cloud
from tests.factories.meshes import bracket


def _zeros(rng: np.random.Generator) -> Case:
    zeros = np.zeros((300, 3))
    return Case(body(rng) + 3, np.vstack([body(rng) + 3, zeros]), rows=zeros)


def _far(rng: np.random.Generator) -> Case:
    return Case(body(rng), body(rng), rows=np.full((30, 3), -9999.0))


def _stray(rng: np.random.Generator) -> Case:
    return Case(body(rng), body(rng), rows=np.array([[1e9, 0, 0]]))


def _copies(rng: np.random.Generator) -> Case:
    return Case(body(rng), body(rng), rows=np.tile(rng.uniform(-4, 4, (1, 3)), (2000, 1)))


def _shell(rng: np.random.Generator) -> Case:
    return Case(body(rng), np.vstack([body(rng), _sphere(rng)]), rows=_sphere(rng))


def _sphere(rng: np.random.Generator) -> Array:
    """Beams without echo, at the largest range."""
    beams = rng.normal(size=(1500, 3))
    return 40 * beams / np.linalg.norm(beams, axis=1)[:, None]


def _dense_spot(rng: np.random.Generator) -> Case:
    points, spot = body(rng, 1500), rng.normal(0, 0.01, (60_000, 3))
    uneven = np.vstack([points, points[0] + spot])
    return Case(uneven, body(rng, 8000), both_ways=True)


def _sparse(rng: np.random.Generator) -> Case:
    return Case(body(rng, 1200), body(rng, 120_000), both_ways=True)


def _mesh(rng: np.random.Generator) -> Case:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "part"
        write_cloud(path, "obj", bracket(6000))
        mesh = read_surface(path).points
        write_cloud(path, "stl", bracket(500))
        scan = read_surface(path, surface_samples=12_000).points
    return Case(mesh / 100, scan / 100 + rng.normal(0, 0.002, scan.shape), both_ways=True)


VALUES: dict[str, Maker] = {
    "zeros, a tenth": _zeros,
    "-9999, one per cent": _far,
    "a point 1e9 away": _stray,
    "a point 2000 times": _copies,
    "beams without echo, a third": _shell,
    "97 % in a dense spot, both ways": _dense_spot,
    "100 times as dense, both ways": _sparse,
    "a mesh, 99.8 % of the vertices in a thread, both ways": _mesh,
}
