"""Flat clouds are aligned within their planes, and unlike outlines are refused."""

import numpy as np
import pytest

from mpe_core import register
from mpe_core.clouds.flat import find_outline, find_plane, lay_flat
from mpe_core.geometry.rigid import apply, axis_rotation, inverse, pose
from tests.factories.checks import assert_pose_close
from tests.factories.clouds import knot, random_rotation


def outline(seed, count):
    rng, t = np.random.default_rng(seed), np.linspace(0, 2 * np.pi, count, endpoint=False)
    waves = [(q, rng.normal(0, 0.3 / q), rng.uniform(0, 6)) for q in range(1, 7)]
    r = 1 + sum(size * np.cos(q * t + phase) for q, size, phase in waves)
    return np.column_stack([r * np.cos(t), r * np.sin(t), 0 * t])


def motion(seed):
    rng = np.random.default_rng(seed)
    return pose(random_rotation(rng), rng.uniform(-3, 3, 3))


@pytest.mark.parametrize("count", [501, 1400])
@pytest.mark.parametrize("seed", [0, 1])
def test_an_outline_is_laid_on_another_sample_of_it(count, seed):
    truth, target = motion(seed), outline(seed, 500)
    source = apply(inverse(truth), outline(seed, count))
    found = register(source, target)
    assert found.accepted
    assert_pose_close(found.T_target_source, truth, source, degrees=0.1, shift=1e-3)
    assert len(found.free_directions) == 0


@pytest.mark.parametrize("seed", [0])
def test_unlike_outlines_are_refused(seed):
    assert not register(apply(motion(seed), outline(seed, 600)), outline(seed + 9, 500)).accepted


@pytest.mark.parametrize("seed", [0])
def test_two_dimensions_stay_two(seed):
    turn = pose(axis_rotation(np.array([0, 0, 1.0]), 2.0 + seed), np.array([1.0, 2, 0]))
    source = apply(inverse(turn), outline(seed, 700))
    found = register(source, outline(seed, 500))
    assert_pose_close(found.T_target_source, turn, source, degrees=0.1, shift=1e-3)
    np.testing.assert_allclose(found.T_target_source[2], [0, 0, 1, 0], atol=1e-12)
    mirrored = register(source * [1, -1, 1], outline(seed, 500))
    assert not mirrored.accepted
    assert any("mirror" in text for text in mirrored.warnings)


def test_a_plate_is_told_by_its_rim():
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(-1, 1, (12000, 2)), np.zeros(12000)])
    plate = points[(points[:, 0] < 0.2) | (points[:, 1] < -0.3)]
    truth = motion(3)
    source = apply(inverse(truth), plate[:4000])
    found = register(source, plate[4000:])
    assert_pose_close(found.T_target_source, truth, source, degrees=2, shift=0.05)
    assert found.accepted


def test_a_body_is_not_flat():
    rng = np.random.default_rng(0)
    assert find_plane(knot(1000, rng)) is None
    assert find_plane(knot(1000, rng) * [1, 1, 1e-3]) is None
    plane = find_plane(outline(0, 100) @ random_rotation(rng))
    assert plane is not None
    assert not plane.is_level


def test_the_outline_of_a_plate_is_its_rim():
    rng = np.random.default_rng(0)
    points = rng.uniform(-1, 1, (4000, 2))
    rim = find_outline(points)
    assert len(rim) < 600
    assert np.median(np.abs(rim).max(axis=1)) > 0.97


@pytest.mark.parametrize("up", [1, -1])
def test_a_pose_is_laid_flat_on_either_side(up):
    turn = axis_rotation(np.array([0, 0, 1.0]), 0.7) @ np.diag([1.0, up, up])
    tilted = axis_rotation(np.array([1.0, 2, 0]), 1e-3) @ turn
    flat = lay_flat(pose(tilted, np.array([1.0, 2, 3])))
    np.testing.assert_allclose(flat[:3, :3], turn, atol=2e-3)
    assert np.linalg.det(flat[:3, :3]) == pytest.approx(1)
    assert flat[2].tolist() == [0, 0, up, 0]


@pytest.mark.parametrize(
    ("corners", "others"), [(4, 3), (6, 5), (2, 1)], ids=["square", "hexagon", "rectangle"]
)
@pytest.mark.parametrize("away", [np.eye(4), motion(5)], ids=["level", "in space"])
def test_an_outline_that_fits_turned_is_ambiguous(corners, others, away):
    rng = np.random.default_rng(1)
    target, source = (plate(corners, rng) for _ in range(2))
    source = apply(inverse(away), source)
    found = register(source, target)
    assert found.accepted
    assert found.ambiguous
    assert len(found.alternatives) >= others
    for T in (found.T_target_source, *found.alternatives):
        assert share_inside(apply(T, source), corners) > 0.98


def plate(corners, rng):
    """Points of a regular polygon, or of a rectangle."""
    points = np.column_stack([rng.uniform(-1, 1, (12000, 2)), np.zeros(12000)])
    return points[is_inside(points, corners)][:4000]


def is_inside(points, corners, margin=0.0):
    if corners == 2:
        return (np.abs(points) < np.array([1, 0.6, 1e-6]) + margin).all(axis=1)
    angles = 2 * np.pi * np.arange(corners) / corners
    sides = np.column_stack([np.cos(angles), np.sin(angles)])
    return ((points[:, :2] @ sides.T).max(axis=1) < 0.8 + margin) & (np.abs(points[:, 2]) < 1e-2)


def share_inside(points, corners):
    return is_inside(points, corners, margin=0.03).mean()
