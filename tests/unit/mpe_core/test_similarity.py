"""The scale next to a pose is refined on the prepared clouds, whichever of them is moved."""

from __future__ import annotations

import numpy as np
import pytest

from mpe_core import RegistrationOptions
from mpe_core.clouds.validate import validate_cloud
from mpe_core.exchanged_pipeline import ExchangedPipeline
from mpe_core.geometry.validation import is_rotation
from mpe_core.pipeline import PosePipeline
from mpe_core.progress import Progress
from mpe_core.refine.full_sum import FullSum
from mpe_core.refine.swapped import SwappedPointToPlane
from mpe_core.rigid_registration import Attempt, register_rigidly
from mpe_core.similarity import refine_scale
from tests.factories.clouds import Array, knot, random_rotation

FACTOR = 1.04
"""By which the sources are too small."""


def attempt(source: Array, target: Array) -> Attempt:
    """Rigid registration of a source, turned and too small."""
    small = source @ random_rotation(np.random.default_rng(9)).T / FACTOR
    clouds = validate_cloud(small), validate_cloud(target)
    return register_rigidly(*clouds, RegistrationOptions(), Progress(None))


def usual(rng: np.random.Generator) -> tuple[Array, Array]:
    return knot(8000, rng), knot(8000, rng)


def of_a_large_source(rng: np.random.Generator) -> tuple[Array, Array]:
    """The target is a part of the source."""
    part = knot(12_000, rng)
    return knot(12_000, rng), part[part[:, 0] > 0.4]


def of_a_noisy_target(rng: np.random.Generator) -> tuple[Array, Array]:
    """Planes of the source are better."""
    target = knot(20_000, rng)
    return knot(20_000, rng), target + rng.normal(0, 0.01, target.shape)


def of_few_noisy_points(rng: np.random.Generator) -> tuple[Array, Array]:
    """The full sum is minimised."""
    source = knot(3000, rng)
    return source + rng.normal(0, 0.01, source.shape), knot(3000, rng)


@pytest.mark.parametrize(
    ("clouds", "error"),
    [
        (usual, 0.003),
        (of_a_large_source, 0.004),
        # noise of a hundredth of the cloud, a fifth of the tube's least width
        (of_a_noisy_target, 0.03),
        (of_few_noisy_points, 0.03),
    ],
)
def test_the_scale_next_to_a_pose_is_found(clouds, error):
    first = attempt(*clouds(np.random.default_rng(0)))
    pipeline = first.pipeline
    assert isinstance(pipeline, ExchangedPipeline) == (clouds is of_a_large_source)
    assert isinstance(pipeline.planes, SwappedPointToPlane) == (clouds is of_a_noisy_target)
    is_full_sum = isinstance(pipeline, PosePipeline) and isinstance(pipeline.refiner, FullSum)
    assert is_full_sum == (clouds is of_few_noisy_points)
    found = refine_scale(first)
    assert found.factor == pytest.approx(FACTOR, abs=error)
    assert is_rotation(found.rigid_pose[:3, :3])


def test_steps_end_where_the_scale_will_not_change_enough(monkeypatch):
    first = attempt(*usual(np.random.default_rng(0)))
    far, taken = refine_scale(first), []
    refine = PosePipeline.refine
    monkeypatch.setattr(PosePipeline, "refine", lambda *a: taken.append(1) or refine(*a))
    near = refine_scale(first, least_change=0.03)
    assert near.factor == pytest.approx(far.factor, abs=0.005)
    assert taken
    taken.clear()
    assert refine_scale(first, least_change=1.0).factor == 1
    assert not taken
