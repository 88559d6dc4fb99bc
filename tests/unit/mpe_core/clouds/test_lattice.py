"""A solid of voxels is taken by its boundary, and found where it fits exactly."""

import numpy as np
import pytest

from mpe_core import register
from mpe_core.clouds.lattice import find_boundary
from mpe_core.geometry.rigid import apply, inverse, pose
from tests.factories.checks import assert_pose_close
from tests.factories.clouds import knot, random_rotation


def solid(size=14):
    """Voxels of a block with three unlike steps."""
    x, y, z = np.meshgrid(*[np.arange(float(size))] * 3, indexing="ij")
    kept = (x < 6) | (y < 4) | ((z < 3) & (x < 11))
    return np.column_stack([axis[kept] for axis in (x, y, z)])


def test_the_boundary_lacks_a_neighbour():
    block = np.stack(np.meshgrid(*[np.arange(11.0)] * 3), -1).reshape(-1, 3)
    block = np.random.default_rng(0).permutation(block)
    boundary = find_boundary(block)
    assert boundary is not None
    assert (boundary == ((block == 0) | (block == 10)).any(axis=1)).all()


def test_surfaces_and_scattered_points_are_no_solids():
    rng = np.random.default_rng(0)
    sheet = np.stack(np.meshgrid(np.arange(40.0), np.arange(40.0), [0.0]), -1).reshape(-1, 3)
    for cloud in (knot(3000, rng), rng.uniform(-1, 1, (3000, 3)), sheet, sheet[:4]):
        assert find_boundary(cloud) is None


def test_one_point_beside_a_solid_changes_nothing():
    block = np.vstack([solid(), [[30.0, 30, 30]]])
    boundary = find_boundary(block)
    assert boundary is not None
    assert boundary[-1]
    np.testing.assert_array_equal(boundary[:-1], find_boundary(block[:-1]))


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_solid_is_laid_on_itself(seed):
    rng = np.random.default_rng(seed)
    truth, target = pose(random_rotation(rng), rng.uniform(-30, 30, 3)), solid()
    source = apply(inverse(truth), target)
    found = register(source, target)
    assert found.accepted
    assert_pose_close(found.T_target_source, truth, source, degrees=0.5, shift=0.1)
