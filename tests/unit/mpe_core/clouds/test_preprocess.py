"""Thinning of normalized clouds, samples, and the weights of their points."""

import numpy as np
import pytest

from mpe_core import InvalidOptionsError, RegistrationOptions
from mpe_core.clouds.normalize import normalize_pair
from mpe_core.clouds.preprocess import (
    MAX_VOXEL_SIZE,
    MIN_VOXEL_SIZE,
    SAMPLE_POINTS,
    prepare_cloud,
    prepare_clouds,
)
from mpe_core.clouds.validate import validate_cloud
from tests.factories.clouds import knot, sheet


@pytest.fixture(scope="module")
def points():
    return 2 * knot(30_000, np.random.default_rng(0))


def test_the_fine_points_are_denser_than_the_coarse_ones(points):
    cloud = prepare_cloud(points)
    assert len(points) > len(cloud.fine) > len(cloud.surface.points)
    coarser = prepare_cloud(points, 2 * cloud.voxel_size)
    assert len(coarser.fine) < len(cloud.fine)


def test_a_sample_is_drawn_from_the_fine_points_by_the_seed(points):
    cloud = prepare_cloud(points)
    sample = cloud.sample(1)
    assert len(sample.points) == SAMPLE_POINTS
    fine = {tuple(point) for point in cloud.fine.tolist()}
    assert all(tuple(point) in fine for point in sample.points.tolist())
    np.testing.assert_array_equal(sample.points, cloud.sample(1).points)
    assert not np.array_equal(sample.points, cloud.sample(2).points)
    assert len(sample.subset(1000).points) == 1000


def test_only_clouds_with_a_viewpoint_have_outward_normals(points):
    rng = np.random.default_rng(1)
    assert prepare_cloud(points).sample(0).normals is None
    seen = prepare_cloud(sheet(rng, 20_000), viewpoints=np.array([[0.0, 0, 5]]))
    normals = seen.sample(0).normals
    assert seen.surface.oriented
    assert normals is not None
    assert (normals[:, 2] >= 0).all()
    assert np.mean(normals[:, 2] > 0.5) > 0.9


def test_a_sample_follows_the_weights(points):
    weights = np.where(points[:, 0] > np.median(points[:, 0]), 3.0, 1.0)
    plain, weighted = prepare_cloud(points), prepare_cloud(points, weights=weights)
    middle = np.median(points[:, 0])

    def odds(cloud):
        share = np.mean(cloud.sample(0).points[:, 0] > middle)
        return share / (1 - share)

    assert odds(weighted) / odds(plain) == pytest.approx(3, rel=0.15)


def test_points_of_weight_zero_are_not_prepared(points):
    weights = np.where(points[:, 0] > 1, 0.0, 1.0)
    pair = normalize_pair(validate_cloud(points, "source", weights), validate_cloud(points))
    source, target = prepare_clouds(pair, RegistrationOptions())
    kept = pair.source[weights > 0, 0].max()
    assert source.fine[:, 0].max() <= kept + 1e-6
    assert len(source.fine) < len(target.fine)


@pytest.mark.parametrize("factor", [0.9 * MIN_VOXEL_SIZE, 1.1 * MAX_VOXEL_SIZE])
def test_a_voxel_size_out_of_range_is_refused_with_the_range(points, factor):
    pair = normalize_pair(validate_cloud(points), validate_cloud(points))
    with pytest.raises(InvalidOptionsError, match="voxel_size must be from"):
        prepare_clouds(pair, RegistrationOptions(voxel_size=factor * pair.unit))
