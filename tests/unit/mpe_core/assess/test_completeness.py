"""A feature of few points decides between poses that fit alike."""

import numpy as np

from mpe_core import register
from mpe_core.assess.completeness import Completeness
from mpe_core.assess.confidence import Evidence
from mpe_core.geometry.rigid import apply, axis_rotation, inverse, pose, rotation_error
from mpe_core.refine.regime import Regime
from tests.factories.clouds import random_rotation
from tests.factories.parts import mug_on_table, shaft

REGIME = Regime(
    roughness=0.001, spacing=0.01, is_sparse=False, is_noisy=False, is_source_smoother=True
)
FITS = Evidence(coverage=1.0, on_surface_fraction=0.97, surface_agreement=0.97)
UNSURE = Evidence(1.0, 0.999, 0.999, shape_correlation=0.19)
SLID = Evidence(0.8, 0.8, 0.99, shape_correlation=0.27)


def turned(degrees):
    return pose(axis_rotation(np.array([0, 0, 1.0]), np.radians(degrees)), np.zeros(3))


def find_only(*, has_key, degrees):
    rng = np.random.default_rng(0)
    source, target = (shaft(20_000, rng, has_key=has_key).astype(np.float32) for _ in range(2))
    poses = [turned(each) for each in degrees]
    return Completeness(source, target, REGIME).find_only(poses, [FITS] * len(poses))


def test_one_pose_explains_the_key_and_the_others_do_not():
    assert find_only(has_key=True, degrees=(90, 0, 200)) == 1


def test_no_pose_is_the_only_one_where_all_or_none_explain_all():
    assert find_only(has_key=False, degrees=(0, 90, 200)) is None
    assert find_only(has_key=True, degrees=(90, 200)) is None
    assert find_only(has_key=True, degrees=(0,)) is None


def find_mug(*, angles, others=()):
    """Poses of a table with mugs of which one fits, and none convinces by its mean evidence."""
    rng = np.random.default_rng(0)
    source, target = (
        np.vstack([apply(turned(each), mug_on_table(20_000, rng)) for each in (0, *others)])
        for _ in range(2)
    )
    clouds = (each.astype(np.float32) for each in (source, target))
    evidence = [UNSURE if each == 0 else SLID for each in angles]
    return Completeness(*clouds, REGIME).find_only([turned(each) for each in angles], evidence)


def test_a_mug_decides_although_no_pose_convinces_by_itself():
    assert not UNSURE.convinces
    assert find_mug(angles=(50, 0, 166)) == 1
    assert find_mug(angles=(50, 166)) is None


def test_a_turn_that_the_search_did_not_find_is_not_decided():
    assert find_mug(angles=(50, 0, 166), others=(180,)) is None


def test_a_mug_on_a_table_is_found():
    rng = np.random.default_rng(0)
    there, target = mug_on_table(20_000, rng), mug_on_table(20_000, rng)
    truth = pose(random_rotation(rng), rng.uniform(-2, 2, 3))
    found = register(apply(inverse(truth), there), target)
    assert found.accepted
    assert rotation_error(found.T_target_source, truth) < 1


def test_a_key_decides_the_turn_and_the_deviation_says_so():
    rng = np.random.default_rng(0)
    there, target = 100 * shaft(24_000, rng), 100 * shaft(24_000, rng)
    truth = pose(random_rotation(rng), rng.uniform(-200, 200, 3))
    found = register(apply(inverse(truth), there), target)
    assert found.accepted
    assert not found.ambiguous
    off = rotation_error(found.T_target_source, truth)
    assert off < 1
    assert found.free_directions.shape == (0, 6)
    said = np.degrees(np.sqrt(np.linalg.eigvalsh(found.covariance[:3, :3]).max()))
    assert off / 5 < said < 2, "the key tells the turn to some tenths of a degree"
