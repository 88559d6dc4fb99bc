"""What free space says of a right and of a wrong pose of three scenes, as numbers and pictures."""

from __future__ import annotations

import json

import numpy as np
from matplotlib.figure import Figure

from benchmarks.experiment import Experiment, Result, markdown
from benchmarks.recall import is_right
from benchmarks.scenes import SCENES, viewpoint_options
from mpe_core import RegistrationOptions
from mpe_core.assess.free_space import compare_with
from mpe_core.clouds.normalize import normalize_pair
from mpe_core.clouds.preprocess import prepare_clouds
from mpe_core.clouds.validate import validate_cloud
from mpe_core.geometry.range_image import RangeImage
from mpe_core.geometry.rigid import apply, inverse
from mpe_core.geometry.sampling import take_every
from mpe_core.geometry.viewpoints import as_viewpoints
from mpe_core.pipeline import PosePipeline
from mpe_core.search.pose_prior import PosePrior
from mpe_core.search.pose_search import QUICK, THOROUGH
from tests.factories.checks import pose_error
from tests.factories.clouds import Array, Pair, Trial, real_trial

SHOWN = {
    "tls_promenade_scan005_scan003": ("a promenade, terrestrial scanner", (0, 1)),
    "kitti07_000004_000001": ("a street, LiDAR on a car", (0, 1)),
    "room_rgbd_frame3_frame2": ("a room, depth camera", (0, 2)),
}
"""Pairs, what they show, and the axes of the target that are drawn."""

SEED, DRAWN = 1, 4000
COLORS = "#3b6fa0", "#a0a0a0", "#c0392b"
"""Of the source, the target, and of points of either in free space."""

EXTENT = 0.97
"""Share of the target's points along each axis that the picture shows."""


def run() -> Result:
    """Measure, and return the figures that the page shows."""
    return {"scenes": [_scene(*_trial(name)) for name in SHOWN]}


def _trial(name: str) -> tuple[Pair, Trial]:
    pairs = json.loads((SCENES / "pairs.json").read_text())
    pair = next(each for each in pairs if each["id"] == name)
    return pair, real_trial(SCENES, pair, seed=SEED)


def _scene(pair: Pair, trial: Trial) -> Result:
    """Compare the minimum next to the truth with the wrong pose that scores best."""
    clouds = normalize_pair(validate_cloud(trial.source), validate_cloud(trial.target))

    def pipeline_of(options: RegistrationOptions) -> PosePipeline:
        prepared = prepare_clouds(clouds, options)
        return PosePipeline(*prepared, PosePrior(), options, clouds.size_ratio)

    blind, seeing = (
        pipeline_of(options) for options in (RegistrationOptions(), viewpoint_options(pair, trial))
    )
    found = [
        blind.refine(T)
        for level in (QUICK, THOROUGH)
        for T in blind.search.find(level, lambda _: None).poses
    ]
    wrong = [pose for pose in found if not _is_right(pair, trial, clouds.to_caller(pose.minimum.T))]
    poses = {
        "right": blind.refine(clouds.from_caller(trial.T_target_source)),
        "wrong": max(wrong, key=lambda pose: pose.evidence.score),
    }
    return {
        "id": pair["id"],
        "poses": {
            name: {
                "T": clouds.to_caller(pose.minimum.T).tolist(),
                "coverage": pose.evidence.coverage,
                "surface_agreement": pose.evidence.surface_agreement,
                "violation": seeing.score(pose.minimum.T).free_space_violation,
            }
            for name, pose in poses.items()
        },
    }


def _is_right(pair: Pair, trial: Trial, T: Array) -> bool:
    return is_right(pair, *pose_error(T, trial.T_target_source, trial.source))


def _standing(pair: Pair, trial: Trial, T: Array) -> tuple[Array, Array, Array]:
    """Points of both scans in the target's frame, and those that stand in free space."""
    options = viewpoint_options(pair, trial)
    source, target = (take_every(cloud, DRAWN) for cloud in (trial.source, trial.target))
    unit = normalize_pair(validate_cloud(trial.source), validate_cloud(trial.target)).unit
    images = (
        RangeImage(trial.target / unit, as_viewpoints(options.target_viewpoint) / unit),
        RangeImage(trial.source / unit, as_viewpoints(options.source_viewpoint) / unit),
    )
    moved = apply(T, source)
    of_source = compare_with(images[0], moved / unit)[0]
    of_target = compare_with(images[1], apply(inverse(T), target) / unit)[0]
    return moved, target, np.vstack([moved[of_source], target[of_target]])


def draw(result: Result, figure: Figure) -> None:
    """Draw each scene from above: at the right pose on top, at the wrong one below."""
    axes = figure.subplots(2, len(SHOWN))
    for column, scene in enumerate(result["scenes"]):
        title, (i, j) = SHOWN[scene["id"]]
        pair, trial = _trial(scene["id"])
        low, high = np.quantile(trial.target, (1 - EXTENT, EXTENT), axis=0)
        for row, (name, pose) in enumerate(scene["poses"].items()):
            panel = axes[row, column]
            drawn = _standing(pair, trial, np.array(pose["T"]))
            for points, color, size in zip(drawn, COLORS, (0.4, 0.4, 4.0), strict=True):
                panel.scatter(points[:, i], points[:, j], s=size, c=color, linewidths=0)
            panel.set(
                xlim=(low[i], high[i]), ylim=(low[j], high[j]), aspect="equal", xticks=[], yticks=[]
            )
            panel.set_title(f"{name}: {pose['violation']:.1%} in free space", fontsize=8)
        axes[1, column].set_xlabel(title, fontsize=8)


def table(result: Result) -> str:
    """Return the page's text and table in Markdown."""
    lines = [
        (
            SHOWN[scene["id"]][0],
            name,
            f"{pose['coverage']:.0%}",
            f"{pose['surface_agreement']:.2f}",
            f"{pose['violation']:.1%}",
        )
        for scene in result["scenes"]
        for name, pose in scene["poses"].items()
    ]
    return (
        "Each scanner saw through the space between itself and what it measured. At a right pose"
        " the other scan has nothing there; at a wrong one it often has, though as many points lie"
        " on surfaces. Three scenes: the minimum next to the true pose, and of the wrong poses that"
        " the search finds without viewpoints the one that scores best. In the picture, target"
        " grey, source blue, points of either in the free space of the other red.\n\n"
        + markdown(
            ("scene", "pose", "points near the target", "surface agreement", "in free space"), lines
        )
    )


FREE_SPACE_EXPERIMENT = Experiment(
    "free_space", "What free space says of a right and a wrong pose", run, table, draw
)
