"""What each point counts for, in the paper's own methods."""

import numpy as np
import pytest

from mpe_core import RegistrationOptions, register
from mpe_core.geometry.nearest import NearestNeighbors
from mpe_core.geometry.rigid import apply, axis_rotation, inverse, pose
from mpe_core.geometry.sampling import sample_points
from mpe_core.paper.algorithm1 import SOFTENING, run_algorithm1
from mpe_core.paper.barnes_hut_tree import tree_order
from mpe_core.paper.force_field import ExactField, TreeField
from mpe_core.paper.trimmed_icp import MIN_OVERLAP, trimmed_count, trimmed_icp
from tests.factories.checks import assert_pose_close, pose_error
from tests.factories.clouds import Trial, bunny, with_passer

METHODS = [
    {"method": "mpe", "field": "exact"},
    {"method": "mpe", "field": "tree"},
    {"method": "mpl", "search": "sparse"},
]
FALSE = 1500


def weighing(cloud, false):
    return np.repeat([1.0, false], [len(cloud) - FALSE, FALSE])


def found(trial, options, K=None, masses=None):
    return register(
        trial.source,
        trial.target,
        RegistrationOptions(**options),
        source_weights=K,
        target_weights=masses,
    )


# each false point pulls a hundredth as much: 0.4 to 0.5 degrees; without them the last step, 0.06,
# and the bias of the radial S, 0.1 (test_descent)
@pytest.mark.parametrize(("false", "degrees", "shift"), [(0.01, 0.7, 0.02), (0.0, 0.2, 0.01)])
@pytest.mark.parametrize("options", METHODS)
def test_what_weighs_little_does_not_mislead(data, options, false, degrees, shift):
    trial = with_passer(bunny(data), FALSE, np.random.default_rng(0))
    body = trial.source[:-FALSE]
    alone = found(trial, options)
    assert pose_error(alone.T_target_source, trial.T_target_source, body)[0] > 20
    weighed = found(trial, options, weighing(trial.source, false), weighing(trial.target, false))
    assert_pose_close(
        weighed.T_target_source, trial.T_target_source, body, degrees=degrees, shift=shift
    )
    assert weighed.converged
    assert weighed.accepted


@pytest.mark.parametrize("options", METHODS)
def test_points_of_weight_zero_are_as_if_they_were_not_there_but_may_be_inliers(data, options):
    trial = with_passer(bunny(data), FALSE, np.random.default_rng(1))
    one, other = weighing(trial.source, 0), weighing(trial.target, 0)
    weighed = found(trial, options, one, other)
    bare = Trial(trial.source[one > 0], trial.target[other > 0], trial.T_target_source)
    assert weighed.T_target_source.tobytes() == found(bare, options).T_target_source.tobytes()
    beside = np.vstack([trial.source, bare.source])  # the bunny again, of weight 0
    twice = register(
        beside,
        trial.target,
        RegistrationOptions(**options),
        source_weights=np.concatenate([one, np.zeros(len(bare.source))]),
        target_weights=other,
    )
    assert twice.T_target_source.tobytes() == weighed.T_target_source.tobytes()
    assert len(twice.inliers) == len(weighed.inliers) + (weighed.inliers.source < one.sum()).sum()


@pytest.mark.parametrize("options", METHODS)
def test_weights_that_are_all_the_same_say_nothing(data, options):
    trial = with_passer(bunny(data), FALSE, np.random.default_rng(2))
    alone = found(trial, options)
    same = found(trial, options, np.full(len(trial.source), 0.1), np.full(len(trial.target), 1e30))
    assert same.T_target_source.tobytes() == alone.T_target_source.tobytes()


@pytest.mark.parametrize("options", METHODS)
def test_the_unit_of_the_weights_does_not_matter(data, options):
    rng = np.random.default_rng(3)
    trial = with_passer(bunny(data), FALSE, rng)
    K, masses = rng.uniform(0.1, 1, len(trial.source)), rng.uniform(0.1, 1, len(trial.target))
    first = found(trial, options, K, masses).T_target_source
    binary = found(trial, options, 2.0**20 * K, 2.0**-30 * masses).T_target_source
    assert binary.tobytes() == first.tobytes()  # powers of 2 round nothing
    thousand = found(trial, options, 1000 * K, masses / 3000).T_target_source
    np.testing.assert_allclose(thousand, first, atol=1e-4)


def fallen(x, y, field, K=None, masses=None):
    order = tree_order(x)
    x, K = x[order], None if K is None else K[order]
    return run_algorithm1(x, field(y, SOFTENING, masses), 100, lambda fraction: None, K).T


@pytest.mark.parametrize("field", [ExactField, TreeField])
def test_a_point_of_weight_two_is_two_points_in_one_place(data, field):
    """In the source, where it multiplies forces, as in the target, where it is a mass."""
    cloud = bunny(data)
    # the ears weigh twice, and the fall is not from the pose where it ends
    K = 1 + (cloud[:, 1] > np.quantile(cloud[:, 1], 0.8))
    T = pose(axis_rotation(np.array([0.5, 2, 1]), 0.7), np.array([0.1, 0.2, -0.1]))
    source = apply(T, cloud[::2])
    half = K[::2].astype(np.float64)
    weighed = fallen(source, cloud, field, half, K.astype(np.float64))
    copied = fallen(np.repeat(source, K[::2], axis=0), np.repeat(cloud, K, axis=0), field)
    plain = fallen(source, cloud, field)
    rounding = 0.01  # degrees: other cells, and sums in another order
    assert pose_error(weighed, copied, source)[0] < rounding
    assert pose_error(weighed, copied, source)[1] < 1e-4
    assert pose_error(plain, copied, source)[0] > 3 * rounding
    assert_pose_close(weighed, inverse(T), source, degrees=0.3, shift=0.02)


@pytest.mark.parametrize("field", [ExactField, TreeField])
def test_weights_of_one_are_no_weights(data, field):
    cloud = bunny(data)
    source = apply(pose(axis_rotation(np.ones(3), 0.7), np.ones(3) / 5), cloud)
    ones = np.ones(len(cloud))
    assert fallen(source, cloud, field, ones, ones).tobytes() == (
        fallen(source, cloud, field).tobytes()
    )


def test_a_sample_has_each_point_as_often_as_it_weighs():
    points, weights = np.arange(30.0).reshape(10, 3), np.arange(10.0) + 1
    rng = np.random.default_rng(0)
    for count in (5, 11, 550):
        drawn = sample_points(points, count, rng, weights)
        assert len(drawn) == count
        often = np.bincount((drawn[:, 0] / 3).astype(np.int64), minlength=10)
        expected = count * weights / weights.sum()
        assert (np.abs(often - expected) < 1 + 1e-9).all()
    chosen = [sample_points(points, 1, rng, weights)[0, 0] / 3 for _ in range(5500)]
    assert np.std(np.bincount(np.array(chosen, np.int64)) / 5500 - weights / 55) < 0.01


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("overlap", [None, 0.6])
def test_trimming_by_weight_is_trimming_of_copies(seed, overlap):
    rng = np.random.default_rng(seed)
    distance, copies = np.sort(np.abs(rng.normal(size=50)) ** 2), rng.integers(1, 5, 50)
    total = copies.sum()
    kept = trimmed_count(distance, total, overlap, copies.astype(np.float64))
    share = copies.cumsum() / total
    if overlap is None:
        objective = {
            k: np.average(distance[:k] ** 2, weights=copies[:k]) / share[k - 1] ** 3
            for k in range(3, 51)
            if share[k - 1] > MIN_OVERLAP or share[k] > MIN_OVERLAP
        }
        assert kept == min(objective, key=objective.get)
    else:
        assert abs(share[kept - 1] - overlap) <= 4 / total
    as_copies = trimmed_count(np.repeat(distance, copies), total, overlap)
    assert abs(copies[:kept].sum() - as_copies) <= copies.max()


def icp(source, target, overlap=None, K=None, masses=None):
    return trimmed_icp(
        source, NearestNeighbors(target), np.eye(4), overlap, 100, lambda fraction: None, K, masses
    ).T


def test_trimmed_icp_takes_a_source_point_of_weight_two_for_two(data):
    target, rng = bunny(data), np.random.default_rng(5)
    T = pose(axis_rotation(rng.normal(size=3), 0.1), np.array([0.05, 0, 0.02]))
    source = apply(inverse(T), target) + 0.02 * rng.normal(size=target.shape)
    K = rng.integers(1, 4, len(source))
    weighed = icp(source, target, 1.0, K.astype(np.float64))
    copied = icp(np.repeat(source, K, axis=0), target, 1.0)
    np.testing.assert_allclose(weighed, copied, atol=1e-9)
    assert np.abs(icp(source, target, 1.0) - copied).max() > 1e-4
    assert icp(source, target, None, np.ones(len(source))).tobytes() == (
        icp(source, target).tobytes()
    )


def test_trimmed_icp_follows_the_weight_of_the_target(data):
    cloud, shift = bunny(data), np.array([0.03, 0, 0])
    bent = cloud + shift * (cloud[:, :1] > 0)
    masses = np.where(cloud[:, 0] > 0, 1e-3, 1)
    source = cloud + np.array([0, 0.01, 0])
    truth = pose(np.eye(3), np.array([0, -0.01, 0]))
    assert pose_error(icp(source, bent, 1.0), truth, source)[1] > 0.005
    assert_pose_close(
        icp(source, bent, 1.0, masses=masses), truth, source, degrees=0.1, shift=0.001
    )
