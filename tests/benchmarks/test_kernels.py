"""Speed of the kernels: `pytest tests/benchmarks/test_kernels.py --benchmark-enable`.

With `--benchmark-autosave` and `--benchmark-compare` it shows what a change did.
"""

import numpy as np
import pytest

from mpe_core import register
from mpe_core.clouds.normalize import normalize_pair
from mpe_core.clouds.validate import validate_cloud
from mpe_core.geometry.nearest import NearestNeighbors
from mpe_core.geometry.rigid import apply, axis_rotation, pose
from mpe_core.paper.force_field import ExactField
from mpe_core.paper.trimmed_icp import trimmed_icp
from tests.factories.clouds import knot


@pytest.fixture
def cloud():
    return knot(8000, np.random.default_rng(0))


def test_direct_sum(benchmark, cloud):
    force = benchmark(ExactField(cloud, 0.05).force, cloud)
    assert np.isfinite(force).all()


def test_checks_and_centring(benchmark, cloud):
    pair = benchmark(lambda: normalize_pair(validate_cloud(cloud), validate_cloud(cloud)))
    np.testing.assert_array_equal(pair.source, pair.target)


def test_nearest_points(benchmark, cloud):
    distance, _ = benchmark(NearestNeighbors(cloud).nearest, cloud)
    assert not distance.any()


def test_trimmed_icp(benchmark, cloud):
    T = pose(axis_rotation(np.ones(3), 0.1), np.full(3, 0.01))
    start = (apply(T, cloud), NearestNeighbors(cloud), np.eye(4), None, 100, lambda fraction: None)
    found = benchmark(trimmed_icp, *start)
    np.testing.assert_allclose(found.T @ T, np.eye(4), atol=1e-6)


def test_whole_registration(benchmark, cloud):
    T = pose(axis_rotation(np.ones(3), 2.0), np.full(3, 0.5))
    found = benchmark(register, apply(T, cloud), cloud)
    np.testing.assert_allclose(found.T_target_source @ T, np.eye(4), atol=1e-2)
