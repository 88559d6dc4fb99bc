"""The picture of the paper's own descent."""

from __future__ import annotations

import numpy as np
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from benchmarks.experiment import DATA
from benchmarks.pictures.panels import RIGHT, SOURCE, TARGET, WRONG, bare, dots
from benchmarks.pictures.story import Story
from mpe_core.clouds.normalize import normalize_pair
from mpe_core.clouds.validate import validate_cloud
from mpe_core.geometry.rigid import fit, rotation_error
from mpe_core.paper.algorithm1 import SOFTENING, run_algorithm1
from mpe_core.paper.barnes_hut_tree import build_tree, tree_order
from mpe_core.paper.force_field import OPENING_RATIO, ExactField, ForceField, TreeField
from tests.factories.clouds import bunny, moved

Array = NDArray[np.float64]


def algorithm_1(_: Story, figure: Figure) -> None:
    """Draw the cells that stand for the target, and the path of a descent by either sum."""
    left, right = figure.subplots(1, 2)
    trial = moved(bunny(DATA, "bun_zipper_res2"), np.random.default_rng(6))
    pair = normalize_pair(validate_cloud(trial.source), validate_cloud(trial.target))
    source, target = pair.source[tree_order(pair.source)], pair.target
    for name, static, style in (
        ("tree", TreeField(target, SOFTENING), {"color": RIGHT, "lw": 3.0}),
        ("exact", ExactField(target, SOFTENING), {"color": "black", "ls": ":"}),
    ):
        watched = _Watched(static, source)
        run_algorithm1(source, watched, 100, lambda fraction: None)
        path = [rotation_error(T, trial.T_target_source) for T in watched.poses]
        right.plot(path, label=f'field "{name}"', **style)
    right.set(xlabel="iteration", ylabel="degrees from the true rotation")
    right.legend(frameon=False)
    place = target[np.argmax(target[:, 0])]
    cells, points = _seen(target, place)
    shape = 2 * cells[:, 10], 2 * cells[:, 10], np.zeros(len(cells))
    left.add_collection(
        EllipseCollection(
            *shape,
            units="xy",
            offsets=cells[:, :2],
            transOffset=left.transData,
            facecolors="none",
            edgecolors=TARGET,
            linewidths=0.5,
        )
    )
    dots(left, target, WRONG)
    dots(left, points, "black")
    left.plot(*place[:2], "P", color=SOURCE, ms=10)
    bare(left, f"{len(cells)} cells, {len(points)} points pull at the cross")


class _Watched:
    """A field that notes where the source lies when it is asked."""

    def __init__(self, static: ForceField, source: Array) -> None:
        self._static, self._source, self.poses = static, source, list[Array]()

    def force(self, points: Array) -> Array:
        self.poses.append(fit(self._source, points))
        return self._static.force(points)


def _seen(target: Array, place: Array) -> tuple[Array, Array]:
    """Return the cells that stand for their points at a place, and the points that count singly."""
    tree = build_tree(target)
    leaves = len(tree.starts) - 1
    cells, points, waiting = [], [np.empty((0, 3))], [0]
    while waiting:
        k = waiting.pop()
        cell = tree.cells[k]
        if cell[10] < OPENING_RATIO * np.linalg.norm(cell[:3] - place):
            cells.append(cell)
        elif k < leaves - 1:
            waiting += [2 * k + 1, 2 * k + 2]
        else:
            leaf = slice(*tree.starts[k - leaves + 1 : k - leaves + 3])
            points.append(tree.points[:, leaf].T)
    return np.array(cells, float), np.concatenate(points)
