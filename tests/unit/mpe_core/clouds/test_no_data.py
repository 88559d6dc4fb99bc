"""Values that stand for no measurement are found; points are not."""

import numpy as np
import pytest

from mpe_core.clouds.no_data import find_no_data
from tests.factories.checks import pose_error
from tests.factories.clouds import knot, moved, random_rotation


def body(count=3000, seed=0):
    return knot(count, np.random.default_rng(seed)) + np.array([3, 0, 0])


def kinds(points, viewpoint=None):
    left_out, found = find_no_data(points, viewpoint)
    assert left_out.sum() == sum(each.count for each in found)
    return {each.kind: each.count for each in found}


def scan(seed=0, reach=40.0):
    """Beams of a scanner at the origin that see a floor and boxes; the others reach no surface."""
    rng = np.random.default_rng(seed)
    turn, rise = np.meshgrid(np.linspace(0, 2 * np.pi, 360), np.radians(np.linspace(-30, 20, 24)))
    rays = np.stack([np.cos(rise) * np.cos(turn), np.cos(rise) * np.sin(turn), np.sin(rise)], -1)
    rays = rays.reshape(-1, 3)
    ranges = np.where(rays[:, 2] < 0, 1.5 / np.maximum(-rays[:, 2], 1e-9), np.inf)
    wall = rng.uniform(5, 30) / np.maximum(rays @ [1.0, 0, 0], 1e-9)
    ranges = np.minimum(ranges, np.where(rays[:, 2] * wall < 4, wall, np.inf))
    hit = ranges < reach
    ranges = np.where(hit, ranges + rng.normal(0, 0.01, len(rays)), reach)
    return rays * ranges[:, None], hit


@pytest.mark.parametrize("seed", [0, 1])
def test_clean_clouds_have_none(seed):
    points = body(seed=seed)
    grid = np.stack(np.meshgrid(*[np.arange(12.0)] * 3), -1).reshape(-1, 3)
    flat = points * [1, 1, 0]
    ball = points / np.linalg.norm(points, axis=1)[:, None]
    for cloud in (points, np.repeat(points, 3, axis=0), grid, flat, ball, np.r_[ball, ball / 2]):
        assert kinds(cloud) == {}


@pytest.mark.parametrize("share", [0.002, 0.1, 0.6])
def test_zeros_are_left_out(share):
    zeros = int(share * 3000)
    assert kinds(np.vstack([body(), np.zeros((zeros, 3))])) == {"zeros": zeros}
    assert kinds(np.vstack([body(), np.zeros((1, 3))])) == {}


@pytest.mark.parametrize("value", [-9999.0, 1e10, -32768.0])
@pytest.mark.parametrize("columns", [[2], [0, 1, 2]])
def test_repeated_far_values_are_left_out(value, columns):
    points = body()
    points[np.ix_(range(0, 3000, 50), columns)] = value
    assert kinds(points) == {"far": 60}


def test_one_point_far_from_all_others_is_left_out():
    points = body()
    points[7] = [0, 1e9, 0]
    left_out, _ = find_no_data(points)
    assert np.flatnonzero(left_out).tolist() == [7]


def test_one_of_many_copies_is_kept():
    points = body()
    points[::10] = points[5] * 2
    left_out, _ = find_no_data(points)
    assert left_out.sum() == 299
    assert not left_out[0]


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("is_moved", [False, True])
def test_beams_without_echo_are_left_out(seed, is_moved):
    points, hit = scan(seed)
    if is_moved:
        points = points @ random_rotation(np.random.default_rng(seed)).T + [30, -5, 2]
    left_out, _ = find_no_data(points.astype(np.float32).astype(float))
    assert (left_out == ~hit).all()
    assert kinds(points[hit]) == {}


def test_a_body_with_zeros_is_found_and_they_are_named():
    from mpe_core import RegistrationOptions, register

    rng = np.random.default_rng(3)
    trial = moved(body(), rng, largest_deg=180)
    zeros = np.zeros((300, 3))
    found = register(np.vstack([trial.source, zeros]), np.vstack([trial.target, zeros]))
    assert pose_error(found.T_target_source, trial.T_target_source, trial.source)[0] < 1
    assert sum("(0, 0, 0)" in text for text in found.warnings) == 2
    assert found.overlap > 0.9
    assert found.inliers.source.max() < len(trial.source)
    kept = register(
        np.vstack([trial.source, zeros]), trial.target, RegistrationOptions(keep_no_data=True)
    )
    assert not any("(0, 0, 0)" in text for text in kept.warnings)
