"""Trimmed ICP."""

import numpy as np
import pytest

from mpe_core.clouds.normalize import normalize_pair
from mpe_core.clouds.validate import validate_cloud
from mpe_core.geometry.nearest import NearestNeighbors
from mpe_core.geometry.rigid import apply, axis_rotation, inverse, pose
from mpe_core.paper.trimmed_icp import trimmed_count, trimmed_icp
from tests.factories.checks import assert_pose_close
from tests.factories.clouds import bunny, real_pair


def nudge(degrees, shift, seed=0):
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=3)
    R = axis_rotation(rng.normal(size=3), np.radians(degrees))
    return pose(R, shift * direction / np.linalg.norm(direction))


def refined(source, target, T, overlap=None, max_iterations=100):
    return trimmed_icp(source, NearestNeighbors(target), T, overlap, max_iterations, lambda f: None)


@pytest.mark.parametrize("seed", range(5))
def test_the_searched_overlap_minimises_chetverikovs_objective(seed):
    distance = np.sort(np.abs(np.random.default_rng(seed).normal(size=50)) ** 2)
    objective = {k: np.mean(distance[:k] ** 2) / (k / 50) ** 3 for k in range(20, 51)}
    assert trimmed_count(distance, 50, None) == min(objective, key=objective.get)


def test_a_given_overlap_is_kept():
    assert trimmed_count(np.arange(50.0), 50, 0.3) == 15
    assert trimmed_count(np.arange(50.0), 50, 0.01) == 3
    assert trimmed_count(np.arange(3.0), 3, None) == 3


def test_a_nudged_copy_returns_exactly(data):
    cloud = bunny(data)
    truth = inverse(nudge(10, 0.1))
    found = refined(apply(nudge(10, 0.1), cloud), cloud, np.eye(4))
    assert found.converged
    assert_pose_close(found.T, truth, cloud, degrees=1e-6, shift=1e-8)


@pytest.mark.parametrize("overlap", [None, 0.6])
def test_half_a_cloud_is_laid_on_the_other_half(data, overlap):
    cloud = bunny(data, "bun_zipper_res2")
    order = cloud[:, 0].argsort()
    source, target = cloud[order[: 6 * len(cloud) // 10]], cloud[order[2 * len(cloud) // 10 :]]
    T = nudge(5, 0.03)
    found = refined(apply(T, source), target, np.eye(4), overlap)
    assert_pose_close(found.T, inverse(T), source, degrees=0.01, shift=1e-4)


@pytest.mark.parametrize("name", ["bunny_bun045_bun000", "dragon_0_336", "uwa_chef_3_1"])
def test_real_scans_from_ten_degrees_off(data, name):
    trial = real_pair(data, name)
    pair = normalize_pair(validate_cloud(trial.source), validate_cloud(trial.target))
    off = pair.to_caller(nudge(10, 0.1)) @ inverse(pair.to_caller(np.eye(4)))
    centred = inverse(pair.to_caller(np.eye(4))) @ off @ trial.T_target_source
    start = pose(centred[:3, :3], pair.source_centre * 0)
    start[:3, 3] = (
        apply(off @ trial.T_target_source, pair.source_centre[None])[0] - pair.target_centre
    ) / pair.unit
    found = refined(pair.source, pair.target, start)
    diagonal = np.linalg.norm(np.ptp(trial.target, axis=0))
    # the published poses are good to 0.1-0.4 degrees
    assert_pose_close(
        pair.to_caller(found.T),
        trial.T_target_source,
        trial.source,
        degrees=0.5,
        shift=0.005 * diagonal,
    )


def test_a_bound_on_the_iterations_is_kept_and_reported(data):
    cloud = bunny(data)
    found = refined(apply(nudge(20, 0.1), cloud), cloud, np.eye(4), max_iterations=1)
    assert (found.converged, found.iterations) == (False, 1)
