"""The sparse search of the paper."""

import numpy as np

from mpe_core.geometry.rigid import inverse
from mpe_core.paper.sparse_search import search_sparse
from tests.factories.checks import assert_pose_close
from tests.factories.clouds import bunny, moved


def search(trial, seed):
    return search_sparse(trial.source, trial.target, 300, 100, seed, lambda fraction: None)


def test_a_sample_of_each_cloud_finds_the_coarse_pose(data):
    trial = moved(bunny(data), np.random.default_rng(3), largest_deg=60)
    found = search(trial, 0)
    assert found.converged
    assert_pose_close(found.T, trial.T_target_source, trial.source, degrees=8, shift=0.1)


def test_the_seed_decides_the_sample(data):
    trial = moved(bunny(data), np.random.default_rng(3), largest_deg=60)
    np.testing.assert_array_equal(search(trial, 1).T, search(trial, 1).T)
    assert np.abs(inverse(search(trial, 1).T) @ search(trial, 2).T - np.eye(4)).max() > 1e-6
