"""Models in views of a scene, and clouds of unlike density, either way round."""

from __future__ import annotations

import numpy as np
import pytest

from mpe_core import RegistrationOptions, register
from mpe_core.clouds.validate import validate_cloud
from mpe_core.geometry.rigid import apply, inverse, pose
from mpe_core.progress import Progress
from mpe_core.rigid_registration import register_rigidly
from tests.factories.checks import assert_pose_close
from tests.factories.clouds import knot, random_rotation
from tests.factories.parts import bumpy_ball, lay_on_table, seen_from

EYE = np.array([2.5, 1.0, 2.8])


def view(model_seed, rng):
    """A part on a table beside two others, from one side."""
    others = [0.7 * bumpy_ball(20_000, seed, rng) for seed in (101, 102)]
    scene = lay_on_table(bumpy_ball(40_000, model_seed, rng), others, rng)
    seen = rng.permutation(seen_from(scene, EYE))[:20_000]
    return seen + rng.normal(0, 0.0015, seen.shape)


@pytest.mark.parametrize("seed", range(2))
def test_a_model_is_found_in_a_view_of_a_third_of_it(seed):
    rng = np.random.default_rng(seed)
    model, target = bumpy_ball(10_000, seed, rng), view(seed, rng)
    lift = -bumpy_ball(40_000, seed, np.random.default_rng(9))[:, 2].min()
    truth = pose(random_rotation(rng), rng.uniform(-2, 2, 3))
    source = apply(inverse(truth), model + np.array([0, 0, lift]))
    found = register(source, target)
    assert found.accepted
    assert_pose_close(found.T_target_source, truth, source, degrees=1.5, shift=0.02)


def test_a_model_that_the_view_does_not_show_is_refused():
    rng = np.random.default_rng(3)
    clouds = (bumpy_ball(10_000, 7, rng), view(8, rng))
    source, target = (validate_cloud(each, "cloud") for each in clouds)
    # no cause is looked for, which takes twice the time
    attempt = register_rigidly(source, target, RegistrationOptions(), Progress(None))
    assert not attempt.found.accepted


@pytest.mark.parametrize("seed", range(2))
def test_a_hundredth_of_the_density_gives_the_same_either_way_round(seed):
    rng = np.random.default_rng(seed)
    truth = pose(random_rotation(rng), rng.uniform(-2, 2, 3))
    sparse, dense = knot(1000, rng), knot(100_000, rng)
    source = apply(inverse(truth), sparse)
    there, back = register(source, dense), register(dense, source)
    assert there.accepted
    assert back.accepted
    assert_pose_close(there.T_target_source, truth, source, degrees=1, shift=0.01)
    assert_pose_close(
        inverse(back.T_target_source), there.T_target_source, source, degrees=0.5, shift=0.005
    )
