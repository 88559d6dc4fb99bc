"""Most points in one small place do not set the centre and the unit of length."""

import numpy as np
import pytest

from mpe_core import register
from mpe_core.clouds.normalize import robust_radius
from mpe_core.clouds.uneven import even_out
from mpe_core.geometry.rigid import apply, inverse, pose
from tests.factories.checks import assert_pose_close
from tests.factories.clouds import knot, random_rotation, room


def with_dense_spot(cloud, rng, share=0.985):
    """Cloud of which a small ball at one of its points holds that share."""
    count = int(len(cloud) * share / (1 - share))
    spot = rng.normal(size=(count, 3))
    spot *= 0.02 * np.ptp(cloud, axis=0).max() / np.linalg.norm(spot, axis=1)[:, None]
    return np.vstack([cloud, cloud[0] + spot])


def measured(points):
    centre = points.mean(axis=0)
    radius = robust_radius(points, centre)
    return centre, radius, *even_out(points, centre, radius)


@pytest.mark.parametrize("seed", [0, 1])
def test_a_dense_spot_does_not_count(seed):
    rng = np.random.default_rng(seed)
    cloud = room(rng, 900)
    _, _, middle, reach = measured(with_dense_spot(cloud, rng))
    true = np.ptp(cloud, axis=0).max()
    assert np.linalg.norm(middle - cloud.mean(axis=0)) < 0.2 * true
    assert 0.3 * true < reach < true


def test_the_unit_of_length_does_not_depend_on_the_share_in_the_spot():
    found = []
    for share in (0.92, 0.95, 0.97, 0.975, 0.985):
        rng = np.random.default_rng(5)
        found.append(measured(with_dense_spot(knot(1500, rng), rng, share))[3])
    assert np.ptp(found) < 0.15 * np.mean(found)


def test_even_clouds_and_stray_points_are_left_alone():
    rng = np.random.default_rng(0)
    stray = np.vstack([knot(20_000, rng), rng.uniform(-8, 8, (300, 3))])
    for cloud in (knot(3000, rng), room(rng), stray):
        centre, radius, middle, reach = measured(cloud)
        assert (middle == centre).all()
        assert reach == radius


@pytest.mark.parametrize("is_swapped", [False, True])
def test_a_part_with_a_dense_spot_is_found_either_way_round(is_swapped):
    rng = np.random.default_rng(3)
    truth = pose(random_rotation(rng), rng.uniform(-5, 5, 3))
    vertices = apply(inverse(truth), with_dense_spot(room(rng, 1500), rng, 0.97))
    scan = room(rng, 12_000)
    clouds = (scan, vertices) if is_swapped else (vertices, scan)
    found = register(*clouds)
    T = inverse(truth) if is_swapped else truth
    candidates = [found.T_target_source, *found.alternatives]
    errors = [np.abs(apply(each, clouds[0]) - apply(T, clouds[0])).max() for each in candidates]
    assert found.accepted
    best = candidates[int(np.argmin(errors))]
    assert_pose_close(best, T, clouds[0], degrees=3, shift=0.1)
