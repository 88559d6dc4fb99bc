"""What callers know beforehand: each piece settles what the clouds alone leave open."""

from __future__ import annotations

import numpy as np
import pytest

from mpe_core import InvalidOptionsError, InvalidWeightsError, RegistrationOptions, register
from mpe_core.geometry.rigid import apply, axis_rotation, inverse, pose, rotation_error
from tests.factories.checks import assert_pose_close, pose_error
from tests.factories.clouds import bunny, knot, motion, moved, real_pair, room, sheet, turned_over

UP = np.array([0.0, 0.0, 1.0])


def start_near(truth, centre, rng, degrees=20.0, shift=0.2):
    """A pose that differs from the truth by so many degrees, and by the shift at the centre."""
    R = axis_rotation(rng.normal(size=3), np.radians(degrees))
    there = apply(truth, centre[None])[0]
    return pose(R, there - R @ there + shift * UP) @ truth


@pytest.mark.parametrize("seed", range(4))
def test_an_initial_transform_chooses_among_equal_poses(seed):
    rng = np.random.default_rng(seed)
    target, source = room(rng), room(rng)
    half_turns = [np.diag(d) for d in ([1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1])]
    away = motion(source, axis_rotation(rng.normal(size=3), 2.5), rng)
    truth = pose(half_turns[seed], np.zeros(3)) @ inverse(away)
    source = apply(away, source)
    assert register(source, target).ambiguous
    initial = start_near(truth, source.mean(axis=0), rng)
    found = register(source, target, RegistrationOptions(initial_transform=initial))
    assert_pose_close(found.T_target_source, truth, source, degrees=0.5, shift=0.01)
    assert not found.ambiguous
    assert found.accepted


def test_an_initial_transform_is_where_local_methods_start(data):
    trial = moved(bunny(data), np.random.default_rng(3), largest_deg=180)
    R = axis_rotation(UP, 2.8)
    far = register(
        apply(pose(R, UP), trial.source), trial.target, RegistrationOptions(method="mpe")
    )
    initial = start_near(trial.T_target_source @ inverse(pose(R, UP)), UP, np.random.default_rng(1))
    options = RegistrationOptions(method="mpe", initial_transform=initial)
    source = apply(pose(R, UP), trial.source)
    near = register(source, trial.target, options)
    truth = trial.T_target_source @ inverse(pose(R, UP))
    assert pose_error(far.T_target_source, truth, source)[0] > 20
    assert_pose_close(near.T_target_source, truth, source, degrees=1, shift=0.02)


@pytest.mark.parametrize("seed", range(3))
def test_gravity_tells_up_from_down(seed):
    rng = np.random.default_rng(seed)
    target, source = turned_over(room(rng)), turned_over(room(rng))
    away = motion(source, axis_rotation(rng.normal(size=3), 2.0), rng)
    source = apply(away, source)
    down = 5 * (-(away[:3, :3] @ UP) + 0.08 * rng.normal(size=3))  # about, and of any length
    assert register(source, target).ambiguous
    options = RegistrationOptions(source_gravity=down, target_gravity=-UP)
    found = register(source, target, options)
    assert not found.ambiguous
    assert_pose_close(found.T_target_source, inverse(away), source, degrees=0.5, shift=0.01)


def test_yaw_only_keeps_the_vertical_and_so_gains_accuracy():
    errors = []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        target, source = turned_over(room(rng, 3000)), turned_over(room(rng, 3000))
        away = motion(source, axis_rotation(UP, 2.0), rng)
        source = apply(away, source + 0.02 * rng.normal(size=source.shape))
        free = register(source, target, RegistrationOptions(source_gravity=-UP, target_gravity=-UP))
        found = register(source, target, RegistrationOptions(yaw_only=True))
        np.testing.assert_allclose(found.T_target_source[:3, :3] @ UP, UP, atol=1e-12)
        assert_pose_close(found.T_target_source, inverse(away), source, degrees=0.5, shift=0.01)
        errors.append(
            [rotation_error(each.T_target_source, inverse(away)) for each in (free, found)]
        )
    free_error, yaw_error = np.median(errors, axis=0)
    assert yaw_error < 0.8 * free_error


@pytest.mark.parametrize("seed", range(3))
def test_viewpoints_settle_the_flip_of_a_thin_part(seed):
    rng = np.random.default_rng(seed)
    target, source = sheet(rng), sheet(rng)
    seen_from = 3 * UP
    away = motion(source, axis_rotation(rng.normal(size=3), 2.2), rng)
    source = apply(away, source)
    alone = register(source, target)
    options = RegistrationOptions(
        source_viewpoint=apply(away, seen_from[None])[0], target_viewpoint=seen_from
    )
    found = register(source, target, options)
    assert alone.ambiguous
    assert_pose_close(found.T_target_source, inverse(away), source, degrees=1, shift=0.01)
    assert not found.ambiguous


def test_points_of_weight_zero_do_not_mislead(data):
    rng = np.random.default_rng(4)
    rigid = bunny(data, "bun_zipper_res2")
    passer = 2 * knot(5 * len(rigid), rng)
    target = np.vstack([rigid, passer + np.array([1.5, 0, 0])])
    R = axis_rotation(rng.normal(size=3), 2.0)
    elsewhere = apply(pose(axis_rotation(UP, 1.0), np.array([-1.0, 0.8, 0.3])), passer)
    trial = np.vstack([rigid, elsewhere])
    away = motion(trial, R, rng)
    source = apply(away, trial)
    weights = np.repeat([1.0, 0.0], [len(rigid), len(passer)])
    alone = register(source, target)
    found = register(source, target, source_weights=weights, target_weights=weights)
    assert pose_error(alone.T_target_source, inverse(away), source)[0] > 5
    assert_pose_close(
        found.T_target_source, inverse(away), source[: len(rigid)], degrees=0.2, shift=0.01
    )
    assert found.accepted


@pytest.mark.parametrize("name", ["bun_zipper_res3", "bun_zipper_res2"])
def test_weights_say_how_much_points_count(data, name):
    """Half of the source is a shifted copy; the weights decide which half the pose follows."""
    target = bunny(data, name)
    shift = np.array([0.02, -0.01, 0.015])
    source = np.vstack([target, target + shift])
    for share in (0.02, 0.98):
        weights = np.repeat([1 - share, share], len(target))
        found = register(source, target, source_weights=weights)
        followed = shift if share > 0.5 else np.zeros(3)
        np.testing.assert_allclose(found.T_target_source[:3, 3], -followed, atol=0.004)


@pytest.mark.parametrize(
    "wrong",
    [np.ones(5), -np.ones(3), np.zeros(3), ["a", "b", "c"], 1.0, [1, 1, 1e-40], [1, 1, 1e40]],
)
def test_weights_that_do_not_fit_are_refused(wrong):
    with pytest.raises(InvalidWeightsError, match="source"):
        register(np.eye(3), np.eye(3), source_weights=wrong)


def test_a_known_overlap_makes_a_small_one_surer(data):
    trial = real_pair(data, "bunny_bun180_bun090")
    source = trial.source + 0.0006 * np.random.default_rng(0).normal(size=trial.source.shape)
    alone = register(source, trial.target)
    found = register(source, trial.target, RegistrationOptions(overlap=0.37))
    assert found.accepted
    assert 1 - found.confidence < 0.7 * (1 - alone.confidence)
    assert_pose_close(found.T_target_source, trial.T_target_source, source, degrees=2, shift=0.005)


def test_what_lies_beyond_an_end_of_the_target_says_nothing_against_a_pose(data):
    trial = real_pair(data, "dragon_264_192")  # two thirds of the source face nothing
    found = register(trial.source, trial.target)
    assert found.accepted
    assert_pose_close(
        found.T_target_source, trial.T_target_source, trial.source, degrees=2, shift=0.005
    )


def test_a_coarser_voxel_evens_out_noise(data):
    model = bunny(data, "bun_zipper")
    errors = []
    for seed in range(2):
        trial = moved(model, np.random.default_rng(seed), largest_deg=180, noise=0.05)
        usual = register(trial.source, trial.target)
        coarse = register(trial.source, trial.target, RegistrationOptions(voxel_size=0.02))
        assert coarse.confidence > usual.confidence
        errors.append(
            [
                rotation_error(each.T_target_source, trial.T_target_source)
                for each in (usual, coarse)
            ]
        )
    usual_error, coarse_error = np.mean(errors, axis=0)
    assert coarse_error < 0.5 * usual_error


@pytest.mark.parametrize("size", [1, 1e-9])
def test_a_voxel_of_no_use_is_refused(data, size):
    model = bunny(data)
    with pytest.raises(InvalidOptionsError, match="a thousandth and a fifth of the radius"):
        register(model, model, RegistrationOptions(voxel_size=size))


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"source_viewpoint": (0, 0, 1)}, "needs target_viewpoint: give both"),
        ({"target_gravity": (0, 0, 1)}, "needs source_gravity: give both"),
        ({"source_gravity": (0, 0, 0), "target_gravity": (0, 0, 1)}, "must be a direction"),
        ({"source_gravity": (0, 1), "target_gravity": (0, 0, 1)}, "3 finite numbers"),
        ({"source_gravity": (0, 1, np.nan), "target_gravity": (0, 0, 1)}, "3 finite numbers"),
        ({"source_gravity": (0, 1, 1e300), "target_gravity": (0, 0, 1)}, "at most 1e[+]15"),
        ({"initial_transform": 2 * np.eye(4)}, "must be rigid"),
        ({"initial_transform": np.diag([1, 1, -1, 1])}, "must be rigid"),
        ({"initial_transform": np.eye(3)}, "must be 4x4 or 3x4"),
        ({"initial_transform": "here"}, "must be 4x4 or 3x4"),
        ({"yaw_only": 1}, "true or false"),
        ({"voxel_size": 0}, "above 0"),
        ({"max_rotation_deg": 20}, "max_rotation_deg needs initial_transform"),
        ({"max_rotation_deg": 181, "initial_transform": np.eye(4)}, "at most 180, got 181"),
        ({"max_translation": 0, "initial_transform": np.eye(4)}, "above 0, got 0"),
        ({"yaw_only": True, "method": "mpe"}, "yaw_only needs method"),
        ({"voxel_size": 0.1, "search": "sparse"}, "voxel_size needs method"),
    ],
)
def test_what_makes_no_sense_is_refused(options, reason):
    with pytest.raises(InvalidOptionsError, match=reason):
        RegistrationOptions(**options)


def test_options_with_arrays_are_the_same_as_with_tuples():
    initial = pose(axis_rotation(UP, 0.5), np.arange(3.0))
    assert RegistrationOptions(initial_transform=initial) == RegistrationOptions(
        initial_transform=tuple(tuple(row) for row in initial.tolist())
    )
