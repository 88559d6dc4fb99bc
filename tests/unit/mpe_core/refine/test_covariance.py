"""The covariance against the scatter over noise, and the directions that nothing resists."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mpe_core import RegistrationOptions, register
from mpe_core.geometry.rigid import apply, axis_rotation, inverse, pose
from mpe_core.refine.covariance import MotionAxes, sandwich_covariance
from tests.factories.clouds import bunny, moved


def error(found, truth, centre):
    """(6,) small motion from the true pose to the found one, about the moved centroid."""
    E = found.T_target_source @ inverse(truth)
    there = apply(truth, centre[None])[0]
    turn = Rotation.from_matrix(E[:3, :3]).as_rotvec()
    return np.concatenate([turn, apply(E, there[None])[0] - there])


CASES = {
    "dense": ("bun_zipper", 0.006, 8),
    "sparse": ("bun_zipper_res3", 0.004, 16),
    "sparse, in noise": ("bun_zipper_res3", 0.03, 16),
}


@pytest.mark.parametrize("case", CASES)
def test_the_covariance_is_the_scatter_over_noise(data, case):
    name, noise, seeds = CASES[case]
    model = 3 * bunny(data, name) + [7, -4, 2]
    rng = np.random.default_rng(2)
    truth = pose(axis_rotation(rng.normal(size=3), 0.7), rng.normal(size=3))
    errors, covariances = [], []
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        target = apply(truth, model) + 3 * noise * rng.normal(size=model.shape)
        source = model + 3 * noise * rng.normal(size=model.shape)
        found = register(source, target, RegistrationOptions(seed=seed))
        errors.append(error(found, truth, model.mean(axis=0)))
        covariances.append(found.covariance)
    seen = np.sqrt(np.mean(np.square(errors), axis=0))
    said = np.sqrt(np.diag(np.median(covariances, axis=0)))
    # of a standard deviation from so few seeds a factor of 1.4 and less is chance
    np.testing.assert_array_less(seen / said, 2.0)
    np.testing.assert_array_less(said / seen, 2.0)
    lengths = [e @ np.linalg.solve(c, e) for e, c in zip(errors, covariances, strict=True)]
    assert 2 < np.median(lengths) < 14, "6 degrees of freedom have 5.3 in the median"


def cylinder(rng, count):
    angle = rng.uniform(0, 2 * np.pi, count)
    return np.column_stack([0.3 * np.cos(angle), 0.3 * np.sin(angle), rng.uniform(-1, 1, count)])


def sphere(rng, count):
    points = rng.normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1)[:, None]


def plane(rng, count):
    return np.column_stack([rng.uniform(-1, 1, (count, 2)), np.zeros(count)])


def street(rng, count):
    ground = np.column_stack(
        [rng.uniform(-1, 1, count), rng.uniform(-0.3, 0.3, count), np.zeros(count)]
    )
    walls = np.column_stack(
        [rng.uniform(-1, 1, count), rng.choice([-0.3, 0.3], count), rng.uniform(0, 0.3, count)]
    )
    return np.vstack([ground, walls])


@pytest.mark.parametrize(
    ("shape", "expected", "noise"),
    [
        (sphere, ["turn x", "turn y", "turn z"], 0),
        (sphere, ["turn x", "turn y", "turn z"], 0.005),
        (cylinder, ["turn z", "move z"], 0),
        (cylinder, ["turn z", "move z"], 0.005),
        # without noise it is flat, and its outline tells
        (plane, ["turn z", "move x", "move y"], 0.005),
        (street, ["move x"], 0),
        (street, ["move x"], 0.002),
    ],
)
def test_directions_that_nothing_resists_are_named(shape, expected, noise):
    rng = np.random.default_rng(3)
    unit = 40.0
    target, source = (unit * (shape(rng, 6000) + noise * rng.normal(size=3)) for _ in range(2))
    target = target + unit * noise * rng.normal(size=target.shape)
    R, away = axis_rotation(rng.normal(size=3), 0.3), rng.normal(size=3)
    found = register(apply(pose(R, away), source), target)
    T = found.T_target_source
    names = ["turn x", "turn y", "turn z", "move x", "move y", "move z"]
    wanted = np.eye(6)[[names.index(name) for name in expected]]
    # whatever equal pose was found, the free motions are those of the target's shape
    centre = apply(T, apply(pose(R, away), source).mean(axis=0)[None])[0]
    motions = found.free_directions / np.array([1, 1, 1, unit, unit, unit])
    motions[:, 3:] -= np.cross(motions[:, :3], centre / unit)  # about the target's origin
    assert len(motions) == len(expected)
    basis, _ = np.linalg.qr(motions.T)
    shares = np.linalg.norm(basis.T @ wanted.T, axis=0)
    assert shares.min() > 0.98, dict(zip(expected, shares, strict=True))
    assert any("free_directions" in text for text in found.warnings)
    for motion in found.free_directions:
        said = motion @ np.linalg.solve(found.covariance, motion)
        assert said == pytest.approx(1, rel=0.05), "a radian or a radius along a free direction"


def test_a_bunny_slides_nowhere(data):
    trial = moved(bunny(data), np.random.default_rng(1), largest_deg=180)
    assert register(trial.source, trial.target).free_directions.shape == (0, 6)


@pytest.mark.parametrize(
    ("deviations", "free"),
    [
        ([0.001, 0.002, 0.001, 0.001, 0.08, 0.003], [4]),
        ([0.001, 0.002, 0.001, 0.001, 0.02, 0.003], []),
        ([0.02, 0.03, 0.02, 0.02, 0.08, 0.03], []),  # noise makes all motions unsure
    ],
)
def test_a_motion_that_is_far_less_sure_than_all_others_is_free(deviations, free):
    rng = np.random.default_rng(0)
    turned = np.linalg.qr(rng.normal(size=(6, 6)))[0]
    information = turned @ np.diag(1 / np.square(deviations)) @ turned.T
    found = sandwich_covariance(information, information, MotionAxes(np.eye(6), np.empty((6, 0))))
    expected = np.square(deviations)
    expected[free] = 1
    np.testing.assert_allclose(found.covariance, turned @ np.diag(expected) @ turned.T, atol=1e-9)
    along = np.abs(found.degenerate_directions @ turned)
    np.testing.assert_allclose(along, np.eye(6)[free], atol=1e-9)
