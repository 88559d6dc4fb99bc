"""One picture for each step of the default method."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.spatial import KDTree

from benchmarks.pictures.panels import RIGHT, SOURCE, TARGET, WRONG, dots, legend, panels
from benchmarks.pictures.story import Story
from mpe_core.clouds.surface import Surface
from mpe_core.geometry.rigid import apply, rotation_error
from mpe_core.paper.algorithm1 import SOFTENING
from mpe_core.paper.force_field import ExactField
from mpe_core.search import pose_search as global_search

Array = NDArray[np.float64]

SLAB = 0.015
"""Half thickness of a cut, in radii."""
NEAR = 0.06
"""Points this near the target, in radii, count for the evidence."""
SHADES = 0.004
"""Distance from a plane that is drawn in full color, in radii."""


def clouds(story: Story, figure: Figure) -> None:
    """Draw the two scans as they come, and as the result places them."""
    before, after = panels(figure, 2, ("as they come", "as the result lays them"))
    pair, T = story.pair, story.found[0].minimum.T
    for axes, source in ((before, pair.source), (after, apply(T, pair.source))):
        dots(axes, pair.target, TARGET)
        dots(axes, source, SOURCE)
    legend(figure, before, {"source": SOURCE, "target": TARGET})


def prepare(story: Story, figure: Figure) -> None:
    """Draw the downsampled target with its normals and its weights K_i."""
    left, right = panels(figure, 2, ("normals of the thinned points", "weight K of each point"))
    surface = story.surfaces[1]
    points = surface.points
    ends = points + 0.05 * _outward(surface)
    some = slice(None, None, 2)
    lines = np.stack([points[some, :2], ends[some, :2]], axis=1)
    left.add_collection(LineCollection(lines, colors=TARGET, linewidths=0.6))
    dots(left, points[some], "black")
    shown = right.scatter(*points[:, :2].T, c=surface.weights, s=5, cmap="viridis", lw=0)
    figure.colorbar(shown, ax=right, shrink=0.8)


def votes(story: Story, figure: Figure) -> None:
    """Draw the votes of every rotation's best translation over its error."""
    axes = figure.subplots()
    degrees = np.array([story.degrees(R) for R in story.rotations])
    kept = np.zeros(len(degrees), bool)
    kept[np.argsort(-story.votes, kind="stable")[: global_search.QUICK.candidates]] = True
    for rows, color, text in ((~kept, WRONG, "left out"), (kept, RIGHT, "go down")):
        label = f"{rows.sum()} {text}"
        axes.scatter(degrees[rows], story.votes[rows], s=9, color=color, lw=0, label=label)
    axes.set(xlabel="degrees from the true rotation", ylabel="votes for its best translation")
    axes.legend(frameon=False)


def fields(story: Story, figure: Figure) -> None:
    """Draw a cut through the target: the force of all points, and the energy of the nearest."""
    titles = ("force of all points (Eq. 7)", "P2 energy of one point (Eq. 10)")
    left, right = panels(figure, 2, titles)
    target = story.surfaces[1].points.astype(float)
    level = float(np.median(target[:, 2]))
    low, high = target[:, :2].min(axis=0) - 0.2, target[:, :2].max(axis=0) + 0.2
    fine, extent = _lattice(low, high, 240, level), (low[0], high[0], low[1], high[1])
    rows, columns = fine.shape[:2]
    force = ExactField(target, SOFTENING).force(fine.reshape(-1, 3))
    strength = np.log(np.linalg.norm(force, axis=1)).reshape(rows, columns)
    left.imshow(strength, extent=extent, origin="lower", cmap="Blues", interpolation="nearest")
    coarse = _lattice(low, high, 22, level).reshape(-1, 3)
    arrows = ExactField(target, SOFTENING).force(coarse)[:, :2]
    arrows /= np.linalg.norm(arrows, axis=1)[:, None]
    left.quiver(*coarse[:, :2].T, *arrows.T, angles="xy", scale=32, width=0.003)
    distance = KDTree(target).query(fine.reshape(-1, 3))[0].reshape(rows, columns)
    energy = -(SOFTENING**2) / (distance**2 + SOFTENING**2)
    right.imshow(energy, extent=extent, origin="lower", cmap="Blues_r", interpolation="nearest")
    for axes in (left, right):
        _cut(axes, target, level)


def waves(story: Story, figure: Figure) -> None:
    """Draw score and error of the candidates after each stage."""
    row = figure.subplots(1, len(story.waves), sharey=True, squeeze=False)[0]
    for number, (axes, (poses, scores)) in enumerate(zip(row, story.waves, strict=True), 1):
        degrees = np.array([story.degrees(T) for T in poses])
        right = degrees < 5
        axes.scatter(degrees[~right], scores[~right], s=14, color=WRONG, lw=0)
        axes.scatter(degrees[right], scores[right], s=22, color=RIGHT, lw=0)
        axes.set(title=f"wave {number}: {len(poses)} poses", xlim=(-5, 185))
        axes.set(xlabel="degrees from the truth")
    row[0].set_ylabel("score")


def polish(story: Story, figure: Figure) -> None:
    """Signed distances of the source from the target's planes before and after the polish."""
    polished = story.found[0].minimum.T
    before = min(story.waves[-1][0], key=lambda T: rotation_error(T, polished))
    turn = rotation_error(before, polished)
    titles = f"after the search, {turn:.2f} degrees to go", "after the polish"
    row = panels(figure, 2, titles)
    for axes, T in zip(row, (before, polished), strict=True):
        points, residual = _residuals(story, T)
        colors = {"c": residual, "cmap": "RdBu", "vmin": -SHADES, "vmax": SHADES}
        shown = axes.scatter(*points[:, :2].T, s=6, lw=0, **colors)
    figure.colorbar(shown, ax=row, shrink=0.8, label="distance from the planes, radii")


def evidence(story: Story, figure: Figure) -> None:
    """How the distances from the target's planes are spread at the right pose and at wrong ones."""
    axes = figure.subplots()
    poses = (story.pipeline.refine(T).minimum.T for T in story.waves[-1][0])
    wrong = [T for T in poses if story.degrees(T) > 10]
    for T in (*wrong, story.found[0].minimum.T):
        right = story.degrees(T) < 10
        residual = np.abs(_residuals(story, T)[1])
        shares = np.full(len(residual), 1 / len(residual))
        style = {"color": RIGHT, "lw": 2.5} if right else {"color": WRONG, "lw": 1.0}
        axes.hist(residual, np.linspace(0, NEAR, 31), weights=shares, histtype="step", **style)
    axes.plot([], [], color=RIGHT, lw=2, label="the result")
    axes.plot([], [], color=WRONG, label=f"{len(wrong)} wrong poses, polished")
    axes.set(xlabel="distance from the target's planes, radii", ylabel="share of the near points")
    axes.legend(frameon=False)


def inliers(story: Story, figure: Figure) -> None:
    """Which points of the source have a counterpart."""
    assert story.result is not None
    kept = np.zeros(len(story.pair.source), bool)
    kept[story.result.inliers.source] = True
    points = apply(story.found[0].minimum.T, story.pair.source)
    front, side = panels(figure, 2, ("from the front", "from the side"))
    for axes, columns in ((front, (0, 1)), (side, (2, 1))):
        dots(axes, points[kept], RIGHT, columns)
        dots(axes, points[~kept], SOURCE, columns)
    names = f"{kept.sum()} inliers", f"{(~kept).sum()} without a counterpart"
    legend(figure, front, dict(zip(names, (RIGHT, SOURCE), strict=True)))


def _residuals(story: Story, T: Array) -> tuple[Array, Array]:
    """Return the source points (N, 3) near the target at a pose, and their plane distances."""
    source, target = story.surfaces
    moved = apply(T, source.points)
    distance, row = KDTree(target.points).query(moved)
    near = distance < NEAR
    offset = target.points[row[near]] - moved[near]
    return moved[near], np.einsum("ni,ni->n", offset, _outward(target)[row[near]])


def _outward(surface: Surface) -> Array:
    """(N, 3) normals turned to the viewer, who looks along -z."""
    return np.where(surface.normals[:, 2:] < 0, -1.0, 1.0) * surface.normals


def _lattice(low: Array, high: Array, count: int, level: float) -> Array:
    """(rows, columns, 3) places in the plane z = level."""
    x, y = (np.linspace(low[k], high[k], count) for k in range(2))
    return np.stack([*np.meshgrid(x, y), np.full((count, count), level)], axis=-1)


def _cut(axes: Axes, points: Array, level: float) -> None:
    """Draw the points within SLAB of the plane z = level."""
    dots(axes, points[np.abs(points[:, 2] - level) < SLAB], "black")
