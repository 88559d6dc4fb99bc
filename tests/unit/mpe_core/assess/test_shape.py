"""Whether points meet points of the same local shape."""

import numpy as np
import pytest

from benchmarks.confidence import pipeline_of
from mpe_core.assess.shape import MIN_POINTS, shape_correlation, tells_shape
from mpe_core.geometry.rigid import axis_rotation, pose
from tests.factories.clouds import moved, room


def test_only_the_order_of_the_variation_counts():
    rng = np.random.default_rng(0)
    variation = rng.uniform(0.05, 0.3, 500).astype(np.float32)
    assert shape_correlation(variation, variation**2) == pytest.approx(1)
    assert shape_correlation(variation, 0.4 - variation) == pytest.approx(-1)
    # chance: a standard error of 1 / sqrt(500)
    assert abs(shape_correlation(variation, rng.permutation(variation))) < 4 / np.sqrt(500)


def test_few_points_and_even_surfaces_tell_nothing():
    few = np.arange(MIN_POINTS - 1, dtype=np.float32)
    assert shape_correlation(few, few) == 0
    even = np.full(100, 0.2, np.float32)
    assert shape_correlation(even, even) == 0


def test_noise_alone_is_no_shape():
    rng = np.random.default_rng(0)
    flat = np.column_stack([rng.uniform(-1, 1, (20_000, 2)), 0.01 * rng.normal(size=20_000)])
    _, pipeline = pipeline_of(flat, flat)
    assert not tells_shape(pipeline.planes.variation)
    assert pipeline.score(np.eye(4)).shape_correlation is None
    assert tells_shape(np.linspace(0.01, 0.1, 100, dtype=np.float32))


def test_a_wall_that_slides_on_itself_has_lost_its_shape():
    """All points stay on the walls and floor; the edges do not meet."""
    rng = np.random.default_rng(0)
    trial = moved(room(rng), rng, noise=0.002, largest_deg=0)
    centred, pipeline = pipeline_of(trial.source, trial.target)
    right = pipeline.score(centred.from_caller(trial.T_target_source))
    quarter = pose(axis_rotation(np.array([0.0, 0.0, 1.0]), np.pi / 2), np.zeros(3))
    wrong = pipeline.score(centred.from_caller(quarter @ trial.T_target_source))
    assert right.shape_correlation > 0.6
    assert wrong.shape_correlation < 0.3
    assert right.score > wrong.score + 2
