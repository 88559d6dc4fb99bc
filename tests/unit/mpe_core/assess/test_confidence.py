"""How far to trust a pose of clouds of unlike sizes."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from mpe_core import RegistrationOptions, register
from mpe_core.assess.confidence import MAX_CALIBRATED_SIZE_RATIO, Evidence
from mpe_core.clouds.normalize import robust_radius
from mpe_core.geometry.rigid import apply, axis_rotation, pose
from tests.factories.checks import assert_pose_close, pose_error
from tests.factories.clouds import real_pair


def odds(**said):
    confidence = Evidence(
        coverage=0.9, on_surface_fraction=0.6, surface_agreement=0.6, **said
    ).confidence
    return confidence / (1 - confidence)


@pytest.mark.parametrize("free", [0, 1, 3])
def test_chance_fits_on_a_much_larger_cloud_count_against_a_pose(free):
    """In as many dimensions as a surface has, and those in which it slides on itself."""
    assert odds(size_ratio=MAX_CALIBRATED_SIZE_RATIO, degenerate_dof=free) == pytest.approx(odds())
    assert odds() / odds(
        size_ratio=5 * MAX_CALIBRATED_SIZE_RATIO, degenerate_dof=free
    ) == pytest.approx(5.0 ** (2 + free))


@pytest.mark.parametrize("name", ["dragon_24_0", "bunny_bun045_bun000"])
def test_a_small_part_of_a_scan_is_found_and_accepted(data, name):
    trial = real_pair(data, name)
    middle = np.argmin(np.linalg.norm(trial.source - trial.source.mean(axis=0), axis=1))
    part = ball(trial, trial.source[middle], 6)
    found = register(part, trial.target)
    assert found.accepted
    # a sixth of the length tells the rotation six times less exactly; the truth is good to 0.4
    assert_pose_close(
        found.T_target_source, trial.T_target_source, part, degrees=2.4, shift=0.02 * whole(trial)
    )


def whole(trial):
    return robust_radius(trial.target, trial.target.mean(axis=0))


def ball(trial, centre, fraction):
    return trial.source[np.linalg.norm(trial.source - centre, axis=1) < whole(trial) / fraction]


def patches_of_ground(trial, fraction):
    for centre in trial.source[np.random.default_rng(1).integers(len(trial.source), size=200)]:
        part = ball(trial, centre, fraction)
        if len(part) >= 800:
            least, middle, _ = np.linalg.eigvalsh(np.cov(part.T))
            if np.sqrt(least / middle) < 0.15:
                yield part


def near_truth(trial, part):
    """The true pose, 15 degrees and 0.3 radii of the part off."""
    middle = apply(trial.T_target_source, part.mean(axis=0, keepdims=True))[0]
    away = 0.3 * robust_radius(part, part.mean(axis=0)) * np.array([1, 0, 0])
    turn = pose(axis_rotation(np.array([1.0, 1.0, 0.0]), np.radians(15)), np.zeros(3))
    centred = pose(np.eye(3), -middle) @ trial.T_target_source
    return pose(np.eye(3), middle + away) @ turn @ centred


@pytest.fixture(scope="module")
def street(data):
    """A street scan on the next one, and eight patches of its ground, an eighth as wide."""
    trial = real_pair(data, "kitti10m_020")
    return trial, list(islice(patches_of_ground(trial, 8), 8))


@pytest.fixture(scope="module")
def alone(street):
    """The patches registered without a word where they lie."""
    return list(registered(street))


def registered(street, *, near=False):
    """For each patch the result, and whether it lies right."""
    trial, patches = street
    for part in patches:
        initial = near_truth(trial, part).tolist() if near else None
        found = register(part, trial.target, RegistrationOptions(initial_transform=initial))
        turned, away = pose_error(found.T_target_source, trial.T_target_source, part)
        yield found, turned < 2 and away < 0.5


def test_patches_of_ground_do_not_pass_where_they_do_not_belong(street, alone, monkeypatch):
    """Of eight six are found elsewhere, 4 to 15 m off."""
    elsewhere = [found for found, is_right in alone if not is_right]
    assert len(elsewhere) >= 4
    assert not any(found.accepted for found in elsewhere)
    monkeypatch.setattr("mpe_core.refine.covariance.count_degenerate", lambda information: 0)
    doubts = np.array([found.confidence for found in elsewhere])
    others = np.array([found.confidence for found, is_right in registered(street) if not is_right])
    assert np.median(others) > 3 * np.median(doubts), "the free directions make the difference"


def test_who_says_where_to_look_has_patches_of_ground_accepted(street, alone):
    rights = [is_right for found, is_right in registered(street, near=True) if found.accepted]
    assert rights.count(True) >= 4
    assert [is_right for found, is_right in alone if found.accepted].count(True) <= 2


def test_what_contradicts_a_pose_lowers_its_confidence_and_its_rank():
    plain = Evidence(coverage=0.8, on_surface_fraction=0.7, surface_agreement=0.85)
    best = replace(plain, layer_support=0.9)
    assert best.accepted
    assert best.confidence == plain.confidence
    surpassed = replace(plain, layer_support=0.0)
    assert not surpassed.accepted
    assert surpassed.sort_key < best.sort_key
    seen = replace(plain, free_space_violation=0.02)
    assert seen.accepted
    contradicted = replace(plain, free_space_violation=0.4)
    assert not contradicted.accepted
    assert contradicted.sort_key < seen.sort_key


def test_free_space_counts_for_a_small_overlap_that_fits():
    little = Evidence(coverage=0.2, on_surface_fraction=0.15, surface_agreement=0.8)
    assert not little.accepted
    assert replace(little, free_space_violation=0.0).accepted
