"""What `register` does with a pair, noted step by step."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from benchmarks.experiment import DATA
from mpe_core import Registration, RegistrationOptions, register
from mpe_core.clouds.normalize import CloudPair, normalize_pair
from mpe_core.clouds.surface import Surface
from mpe_core.clouds.validate import validate_cloud
from mpe_core.geometry.rigid import rotation_error
from mpe_core.pipeline import PosePipeline
from mpe_core.search import pose_search as global_search
from tests.factories.clouds import real_pair

Array = NDArray[np.float64]

PAIR = "bunny_bun090_bun045"


@dataclass
class Story:
    """What `register` did with a pair, step by step; poses are between the centered clouds."""

    pair: CloudPair
    R_true: Array
    result: Registration | None = None
    pipeline: Any = None
    found: Any = None
    rotations: Array = field(default_factory=lambda: np.empty((0, 3, 3)))
    votes: Array = field(default_factory=lambda: np.empty(0))
    waves: list[tuple[Array, Array]] = field(default_factory=list)
    """Poses and scores after each wave."""

    def degrees(self, T: Array) -> float:
        """Return the rotation error of a pose, in degrees."""
        return rotation_error(T[:3, :3], self.R_true)

    @property
    def surfaces(self) -> tuple[Surface, Surface]:
        """Surfaces of source and target."""
        return self.pipeline.source.surface, self.pipeline.target.surface


def tell() -> Story:
    """Register the pair, and note what each step came to."""
    trial = real_pair(DATA, PAIR)
    pair = normalize_pair(validate_cloud(trial.source), validate_cloud(trial.target))
    story = Story(pair, trial.T_target_source[:3, :3])

    def vote(rotations: Array, *rest: Any) -> Any:
        translations, votes = best_translations(rotations, *rest)
        story.rotations, story.votes = rotations.astype(float), votes
        return translations, votes

    def wave(poses: Array, *rest: Any) -> Any:
        scores = descend_wave(poses, *rest)
        story.waves.append((poses.copy(), scores.copy()))
        return scores

    def run(pipeline: PosePipeline, *rest: Any) -> Any:
        story.pipeline = pipeline
        story.found = all_steps(pipeline, *rest)
        return story.found

    best_translations, descend_wave = global_search.best_translations, global_search._descend
    all_steps = PosePipeline.run
    with (
        patch.object(global_search, "best_translations", vote),
        patch.object(global_search, "_descend", wave),
        patch.object(PosePipeline, "run", run),
    ):
        story.result = register(trial.source, trial.target, RegistrationOptions())
    return story
