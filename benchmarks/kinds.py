"""Clouds as they come: kinds of trouble in the input, each over random starts."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.experiment import Experiment, Result, markdown
from mpe_core import Registration, RegistrationOptions, register
from mpe_core.geometry.rigid import apply, inverse, pose
from service.formats import read_surface, write_cloud
from tests.factories.clouds import knot, random_rotation
from tests.factories.meshes import bracket
from tests.factories.painted import Painted, paint, road, tube, wall

Array = NDArray[np.float64]
Made = tuple[Array, Array, Array | None, RegistrationOptions]
"""Source where it belongs, target, rows of the source that count (None: nothing fits), options."""


class Colored(NamedTuple):
    """Clouds with the brightness of their points."""

    made: Made
    colors: tuple[Array, Array]


SEEDS = 20
MAX_OFF = 0.05
"""Distance from its place, over the size of the source, up to which a pose is right."""
PLAIN = RegistrationOptions()


def _body(rng: np.random.Generator, count: int = 3000) -> Array:
    return knot(count, rng) + rng.normal(0, 0.002, (count, 3))


def _with_rows(rng: np.random.Generator, rows: Array) -> Made:
    body = _body(rng)
    return np.vstack([body, rows]), _body(rng), np.arange(len(body)), PLAIN


def _zeros(rng: np.random.Generator) -> Made:
    body, target = _body(rng) + 3, _body(rng) + 3
    zeros = np.zeros((300, 3))
    source = np.vstack([body, np.full((300, 3), 2 * body[0])])  # what a motion makes of zeros
    return source, np.vstack([target, zeros]), np.arange(len(body)), PLAIN


def _far(rng: np.random.Generator) -> Made:
    return _with_rows(rng, np.full((30, 3), -9999.0))


def _stray(rng: np.random.Generator) -> Made:
    return _with_rows(rng, np.array([[1e9, 0, 0]]))


def _markers(rng: np.random.Generator) -> Made:
    points = rng.uniform(-1, 1, (rng.integers(6, 60), 3))
    return points, rng.permutation(points), np.arange(len(points)), PLAIN


def _other_markers(rng: np.random.Generator) -> Made:
    count = rng.integers(6, 60)
    return rng.uniform(-1, 1, (count, 3)), rng.uniform(-1, 1, (count, 3)), None, PLAIN


def _volume(rng: np.random.Generator) -> Array:
    count = rng.integers(1001, 6000)
    if rng.random() < 0.5:
        return rng.normal(0, 0.4, (count, 3))
    return rng.uniform(-1, 1, (count, 3)) * rng.uniform(0.4, 1, 3)


def _volumes(rng: np.random.Generator) -> Made:
    points = _volume(rng)
    source = rng.permutation(points)[: 2 * len(points) // 3]
    return source, points, np.arange(len(source)), PLAIN


def _other_volumes(rng: np.random.Generator) -> Made:
    return _volume(rng), _volume(rng), None, PLAIN


def _outline(rng: np.random.Generator, count: int) -> Array:
    t = np.linspace(0, 2 * np.pi, count, endpoint=False)
    size, phase = rng.normal(0, 0.3, 6) / np.arange(1, 7), rng.uniform(0, 6, 6)
    waves = size[:, None] * np.cos(np.arange(1, 7)[:, None] * t + phase[:, None])
    r = 1 + waves.sum(axis=0)
    return np.column_stack([r * np.cos(t), r * np.sin(t), 0 * t])


def _outlines(rng: np.random.Generator) -> Made:
    source = _outline(rng, 1200)
    return source[::3], source[1::2], np.arange(400), PLAIN


def _other_outlines(rng: np.random.Generator) -> Made:
    return _outline(rng, 600), _outline(rng, 500), None, PLAIN


def _dense_spot(rng: np.random.Generator) -> Made:
    body, spot = _body(rng, 1500), rng.normal(0, 0.01, (60_000, 3))
    return np.vstack([body, body[0] + spot]), _body(rng, 8000), np.arange(len(body)), PLAIN


def _mesh(rng: np.random.Generator) -> Made:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "part"
        write_cloud(path, "obj", bracket(6000))
        mesh = read_surface(path).points
        write_cloud(path, "stl", bracket(500))
        scan = read_surface(path, surface_samples=12_000).points
    clouds = (mesh, scan) if rng.random() < 0.5 else (scan, mesh)
    clouds = (clouds[0] / 100, clouds[1] / 100 + rng.normal(0, 0.002, clouds[1].shape))
    return *clouds, np.arange(len(clouds[0])), PLAIN


def _colored(rng: np.random.Generator, source: Painted, target: Painted) -> Colored:
    light = source[1] + rng.normal(0, 0.05, len(source[1]))
    made = source[0], target[0], np.arange(len(light)), PLAIN
    return Colored(made, (light, 60 * target[1] - 400))


def _wall(rng: np.random.Generator) -> Colored:
    pattern = paint(rng)
    return _colored(rng, wall(rng, pattern, 0), wall(rng, pattern, rng.uniform(0.5, 1.5)))


def _tube(rng: np.random.Generator) -> Colored:
    return _colored(rng, tube(rng, 0), tube(rng, rng.uniform(1, 4)))


def _road(rng: np.random.Generator) -> Colored:
    return _colored(rng, road(rng, 0), road(rng, rng.uniform(2, 8)))


def _units(rng: np.random.Generator) -> Made:
    factor = rng.choice([0.001, 0.0254, 0.3048, 10.0, 1000.0])
    options = RegistrationOptions(scale="units")
    return _body(rng) / factor, _body(rng), np.arange(3000), options


def _free_scale(rng: np.random.Generator) -> Made:
    options = RegistrationOptions(scale="free")
    return _body(rng) / rng.uniform(0.2, 5), _body(rng), np.arange(3000), options


def _mirrored(rng: np.random.Generator) -> Made:
    return _body(rng) * (-1, 1, 1), _body(rng), None, PLAIN


KINDS: dict[str, Callable[[np.random.Generator], Made | Colored]] = {
    "zeros, a tenth": _zeros,
    "-9999, one per cent": _far,
    "a point 1e9 away": _stray,
    "6 to 60 markers": _markers,
    "unlike markers": _other_markers,
    "volumes of points": _volumes,
    "unlike volumes": _other_volumes,
    "outlines": _outlines,
    "unlike outlines": _other_outlines,
    "97 % in a dense spot": _dense_spot,
    "a mesh, 99.8 % of the vertices in a thread": _mesh,
    "a painted wall": _wall,
    "a painted tube": _tube,
    "a road with markings": _road,
    "other units": _units,
    "any scale": _free_scale,
    "mirrored": _mirrored,
}


def run() -> Result:
    """Measure, and return the figures that the page shows."""
    rows = []
    for kind, make in KINDS.items():
        rows.append({"kind": kind} | _count(make))
        print(rows[-1], flush=True)
    return {"rows": rows}


def _count(make: Callable[[np.random.Generator], Made | Colored]) -> Result:
    tally = {"right": 0, "wrong accepted": 0, "right refused": 0, "refused": 0}
    for seed in range(SEEDS):
        rng = np.random.default_rng(seed)
        made = make(rng)
        colors: tuple[Array | None, Array | None] = (None, None)
        if isinstance(made, Colored):
            made, colors = made
        there, target, counted, options = made
        truth = pose(random_rotation(rng), rng.uniform(-2, 2, 3))
        source = apply(inverse(truth), there)
        found = register(source, target, options, source_colors=colors[0], target_colors=colors[1])
        if counted is None:
            tally["wrong accepted" if found.accepted else "refused"] += 1
            continue
        tally[_judge(found, source[counted], there[counted])] += 1
    return tally


def _judge(found: Registration, source: Array, there: Array) -> str:
    T, wanted = found.T_target_source, there * found.scale
    here = np.einsum("ij,nj->ni", T[:3, :3], source) + T[:3, 3]
    off = float(np.sqrt(np.square(here - wanted).sum(axis=1).mean()))
    is_right = off < MAX_OFF * np.ptp(wanted, axis=0).max()
    if found.accepted and not (len(found.free_directions) and not is_right):
        return "right" if is_right else "wrong accepted"
    return "right refused" if is_right else "refused"


def table(result: Result) -> str:
    """Return the page's text and tables in Markdown."""
    names = list(result["rows"][0])
    rows = [tuple(row[name] for name in names) for row in result["rows"]]
    return (
        f"Generated clouds, {SEEDS} random starts each; a pose is right that puts the source "
        f"within {MAX_OFF:.0%} of its size of its place; a wrong one that "
        f"is said to be free counts as refused. Unlike clouds are to be refused.\n\n"
        + markdown(names, rows)
    )


KINDS_EXPERIMENT = Experiment("kinds", "Clouds as they come", run, table)
