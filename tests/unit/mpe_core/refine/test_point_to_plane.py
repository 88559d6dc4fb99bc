"""Point-to-plane refinement, from either side, and the regime that chooses the side."""

import numpy as np
import pytest

from mpe_core import RegistrationOptions
from mpe_core.clouds.preprocess import prepare_cloud
from mpe_core.clouds.validate import validate_cloud
from mpe_core.geometry.rigid import apply, axis_rotation, inverse, pose, rotation_error
from mpe_core.refine import point_to_plane
from mpe_core.refine.point_to_plane import PointToPlane
from mpe_core.refine.regime import choose_regime
from mpe_core.refine.swapped import SwappedPointToPlane
from mpe_core.refine.target_planes import TargetPlanes, match_planes
from mpe_core.rigid_registration import prepare_pair
from tests.factories.clouds import knot, real_pair

TRUTH = pose(axis_rotation(np.array([1.0, 2, 3]), 0.7), np.array([0.2, -0.1, 0.3]))
OFF = pose(axis_rotation(np.array([-2.0, 1, 0]), 0.06), np.array([0.01, -0.01, 0.005]))


def prepared(seed, noise=0.0, T=None, count=30_000):
    rng = np.random.default_rng(seed)
    points = 2 * knot(count, rng) - [1.1, 0.3, 0.2]
    points += noise * rng.normal(size=points.shape)
    return prepare_cloud(points if T is None else apply(inverse(T), points))


def refiner(source, target, basis=None, **options):
    basis = np.eye(6) if basis is None else basis
    regime = choose_regime(source, target)
    return PointToPlane(source, target, basis, regime, RegistrationOptions(**options))


@pytest.fixture(scope="module")
def clouds():
    """Two samplings of one surface, the first of them moved by the inverse of TRUTH."""
    return prepared(0, T=TRUTH), prepared(1)


def shift_between(T, other):
    return float(np.linalg.norm(T[:3, 3] - other[:3, 3]))


def test_it_finds_the_minimum_next_to_a_coarse_pose(clouds):
    start = OFF @ TRUTH
    assert rotation_error(start, TRUTH) > 3
    minimum = refiner(*clouds).refine(start)
    assert minimum.converged
    assert minimum.criterion in ("point_to_plane", "smoothed_point_to_plane")
    assert rotation_error(minimum.T, TRUTH) < 0.1
    assert shift_between(minimum.T, TRUTH) < 2e-3


def test_a_minimum_stays_where_it_is(clouds):
    found = refiner(*clouds).refine(OFF @ TRUTH)
    again = refiner(*clouds).refine(found.T)
    assert rotation_error(again.T, found.T) < 0.01
    assert shift_between(again.T, found.T) < 2e-4


def test_a_bound_on_the_iterations_is_kept_and_reported(clouds):
    minimum = refiner(*clouds, max_iterations=1).refine(OFF @ TRUTH)
    assert (minimum.converged, minimum.iterations) == (False, 1)


def test_a_pose_that_ran_out_of_steps_goes_on_to_its_minimum(clouds, monkeypatch):
    monkeypatch.setattr(point_to_plane, "MAX_STEPS", 2)
    direct, swapped = refiner(*clouds), SwappedPointToPlane(refiner(*clouds))
    for each, start, truth in (
        (direct, OFF @ TRUTH, TRUTH),
        (swapped, inverse(OFF @ TRUTH), inverse(TRUTH)),
    ):
        near = each.refine(start)
        settled = each.settle(near)
        assert (near.converged, settled.converged) == (False, True)
        assert near.iterations < settled.iterations
        assert rotation_error(near.T, truth) > 2 * rotation_error(settled.T, truth)


def test_a_pose_goes_on_for_no_more_iterations_than_allowed(clouds, monkeypatch):
    monkeypatch.setattr(point_to_plane, "MAX_STEPS", 2)
    limited = refiner(*clouds, max_iterations=3)
    assert limited.settle(limited.refine(OFF @ TRUTH)).iterations == 3


@pytest.mark.parametrize("name", ["kitti07_000004_000001", "kitti07_000004_000002"])
def test_far_walls_hold_the_pose_of_scans_that_are_dense_near_their_scanners(data, name):
    trial = real_pair(data / "scenes", name)
    options = RegistrationOptions()
    pair, clouds = prepare_pair(validate_cloud(trial.source), validate_cloud(trial.target), options)
    planes, truth = refiner(*clouds), pair.from_caller(trial.T_target_source)
    near = planes.settle(planes.refine(truth))
    sharp = planes.sharpen(near)
    assert sharp.converged
    assert sharp.iterations > near.iterations
    assert shift_between(sharp.T, truth) < 0.7 * shift_between(near.T, truth)


@pytest.mark.parametrize(("noise", "count"), [(0.05, 30_000), (0.0, 3000)])
def test_a_minimum_of_noisy_or_sparse_clouds_is_not_sharpened(noise, count):
    blurred = refiner(
        prepared(0, noise=noise, T=TRUTH, count=count), prepared(1, noise=noise, count=count)
    )
    for each, start in (
        (blurred, OFF @ TRUTH),
        (SwappedPointToPlane(blurred), inverse(OFF @ TRUTH)),
    ):
        near = each.refine(start)
        assert each.sharpen(near) is near


def test_sharpening_keeps_the_bound_on_the_iterations_and_the_motion_basis(clouds, monkeypatch):
    monkeypatch.setattr(point_to_plane, "MAX_STEPS", 2)
    limited = refiner(*clouds, basis=np.eye(6)[:, 3:], max_iterations=3)
    near = limited.refine(OFF @ TRUTH)
    sharp = limited.sharpen(near)
    assert sharp.iterations == 3
    assert rotation_error(sharp.T, near.T) < 1e-9


def test_steps_stay_within_the_motion_basis(clouds):
    only_translation = np.eye(6)[:, 3:]
    minimum = refiner(*clouds, basis=only_translation).refine(OFF @ TRUTH)
    assert rotation_error(minimum.T, OFF @ TRUTH) < 1e-9
    assert shift_between(minimum.T, OFF @ TRUTH) > 1e-3


def test_with_source_and_target_exchanged_poses_and_errors_keep_their_meaning(clouds):
    source, target = clouds
    direct = refiner(source, target)
    swapped = SwappedPointToPlane(refiner(target, source))
    one, other = (each.refine(OFF @ TRUTH) for each in (direct, swapped))
    assert rotation_error(one.T, other.T) < 0.1
    assert shift_between(one.T, other.T) < 2e-3
    covariances = [
        each.uncertainty(minimum).covariance for each, minimum in ((direct, one), (swapped, other))
    ]
    ratio = np.sqrt(np.diag(covariances[0]) / np.diag(covariances[1]))
    np.testing.assert_array_less(ratio, 3)
    np.testing.assert_array_less(1 / ratio, 3)


def test_planes_hold_their_points_and_normals_have_unit_length(clouds):
    _, target = clouds
    planes = TargetPlanes(target.fine, target.surface.spacing)
    rows = np.arange(0, len(target.fine), 50, dtype=np.int32)
    feet, normals, variation = planes.planes_at(rows)
    known = variation[~np.isnan(variation)]
    assert len(known) > len(rows) / 2
    assert ((known >= 0) & (known <= 1 / 3 + 1e-6)).all()
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-5)
    away = planes.cells.points[rows] - feet
    along = np.einsum("ni,ni->n", away, normals)
    np.testing.assert_allclose(np.linalg.norm(away, axis=1), np.abs(along), atol=1e-5)
    assert np.median(np.abs(along)) < 0.1 * planes.radius


def test_a_cloud_matches_itself_without_residuals(clouds):
    _, target = clouds
    matches = match_planes(target.sample(0), TargetPlanes(target.fine, 0.01), np.eye(4))
    assert matches.in_range.all()
    assert matches.valid.all()
    assert not matches.distances().any()
    assert not matches.residuals().any()
    assert matches.weighted_rms(0.01) == 0
    away = pose(np.eye(3), np.full(3, 9.0))
    far = match_planes(target.sample(0), TargetPlanes(target.fine, 0.01), away)
    assert not far.valid.any()
    assert np.isinf(far.distances()).all()
    assert not far.tukey_weights(0.01).any()


def test_noise_decides_the_regime():
    clean, noisy = prepared(2), prepared(3, noise=0.05)
    assert not choose_regime(clean, clean).is_noisy
    for source, target in ((clean, noisy), (noisy, clean)):
        regime = choose_regime(source, target)
        assert regime.is_noisy
        assert regime.plane_noise == regime.roughness > 0.013
        assert regime.takes_planes_of_source == (source is clean)
        assert regime.uses_full_sum == regime.is_sparse


def test_many_poses_refined_at_once_end_where_each_ends_alone(clouds):
    starts = np.array([TRUTH, OFF @ TRUTH, inverse(OFF) @ TRUTH])
    planes = refiner(*clouds)
    together = planes.refine_shortly(starts)
    for start, end in zip(starts, together, strict=True):
        (alone,) = planes.refine_shortly(start[None])
        assert np.array_equal(end, alone)
        assert rotation_error(end, TRUTH) < 0.3
    minima = planes.refine_all(starts)
    for start, minimum in zip(starts, minima, strict=True):
        alone = planes.refine(start)
        assert np.array_equal(minimum.T, alone.T)
        assert (minimum.iterations, minimum.converged) == (alone.iterations, alone.converged)
    swapped = SwappedPointToPlane(refiner(*clouds))
    (back,) = swapped.refine_shortly(np.array([inverse(OFF @ TRUTH)]))
    assert rotation_error(inverse(back), together[1]) < 1e-6


def test_many_poses_stay_within_the_motion_basis(clouds):
    only_translation = np.eye(6)[:, 3:]
    (end,) = refiner(*clouds, basis=only_translation).refine_shortly((OFF @ TRUTH)[None])
    assert rotation_error(end, OFF @ TRUTH) < 1e-9
    assert shift_between(end, OFF @ TRUTH) > 1e-3
