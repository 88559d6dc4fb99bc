"""What a pose has over the different ones found beside it."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.blade import scan
from mpe_core import RegistrationOptions, register
from mpe_core.assess.confidence import MAX_CONTRAST, Evidence
from mpe_core.assess.rivals import ScoredPose, select_equal, with_contrast
from mpe_core.geometry.rigid import inverse, rotation_error
from mpe_core.refine.minimum import Minimum
from tests.factories.clouds import real_pair


def scored(shift, on_surface, coverage=0.9, shape=0.5):
    T = np.eye(4)
    T[0, 3] = shift
    evidence = Evidence(
        coverage=coverage,
        on_surface_fraction=on_surface,
        surface_agreement=0.9,
        shape_correlation=shape,
    )
    return ScoredPose(Minimum(T, True, 1), evidence)


def confidence(*on_surface):
    """Of the first of several poses, which has a little more shape."""
    poses = [scored(float(k), share, shape=0.5 - 0.01 * k) for k, share in enumerate(on_surface)]
    return with_contrast(poses)[0].evidence.confidence


def test_a_pose_that_lays_more_points_on_the_surface_is_surer():
    assert confidence(0.8, 0.5) > confidence(0.8, 0.6) > confidence(0.8, 0.79)


def test_more_than_enough_of_a_lead_says_nothing():
    assert confidence(0.8, 0.3) == confidence(0.8, 0.1)


def test_a_rival_that_lays_more_points_on_the_surface_does_not_count_twice():
    assert confidence(0.5, 0.9) == pytest.approx(confidence(0.5, 0.5))


def test_a_pose_that_only_lays_more_points_on_the_surface_stays_behind():
    slid, right = with_contrast([scored(0, 0.9, shape=0.1), scored(1, 0.4, shape=0.8)])
    assert slid.evidence.contrast < 0 < right.evidence.contrast


def test_the_same_pose_found_again_is_no_rival():
    alone = with_contrast([scored(0, 0.8)])[0].evidence
    again = with_contrast([scored(0, 0.8), scored(1e-4, 0.8)])[0].evidence
    assert again == alone
    assert alone.contrast == MAX_CONTRAST


def flat(shift, agreement, coverage=0.8):
    """A pose of flat sides, which tell no shape."""
    T = np.eye(4)
    T[0, 3] = shift
    share = agreement * coverage
    evidence = Evidence(coverage=coverage, on_surface_fraction=share, surface_agreement=agreement)
    return ScoredPose(Minimum(T, True, 1), evidence)


def test_flat_sides_that_fit_elsewhere_as_well_tell_nothing():
    alone, beside = (
        with_contrast(poses)[0].evidence
        for poses in (
            [flat(0, 0.93), flat(1, 0.6)],
            [flat(0, 0.93), flat(1, 0.92)],
        )
    )
    assert beside.score == alone.score
    assert alone.confidence > 0.9
    assert beside.convinces
    assert not beside.accepted


def test_what_fits_as_a_whole_in_several_ways_is_symmetric():
    whole = with_contrast([flat(0, 0.99, coverage=1.0), flat(1, 0.99, coverage=1.0)])
    best, *others = select_equal(whole)
    assert best.evidence.accepted
    assert len(others) == 1


def test_a_pose_that_is_refused_for_its_rivals_names_them():
    best, *others = select_equal(with_contrast([flat(0, 0.93), flat(1, 0.92), flat(2, 0.5)]))
    assert not best.evidence.accepted
    assert [pose.minimum.T[0, 3] for pose in others] == [1.0]


def seen(shift, on_surface, violation):
    """A pose with so much free space violated."""
    pose = scored(shift, on_surface)
    return replace(pose, evidence=replace(pose.evidence, free_space_violation=violation))


def test_what_free_space_refutes_is_no_pose_that_fits_as_well():
    """A cloud that slides on ground and walls lies on as much surface, but not where it may."""
    for violation, count in ((0.02, 2), (0.4, 1)):
        poses = with_contrast([seen(0, 0.6, 0.0), seen(1, 0.7, violation)])
        assert len(select_equal(poses)) == count


def test_beside_others_that_fit_as_well_nothing_is_sure(data):
    trial = real_pair(data, "bunny_bun045_bun000")
    twice = np.vstack([trial.target, trial.target + np.array([0.3, 0, 0])])
    alone, beside = (register(trial.source, target) for target in (trial.target, twice))
    assert alone.confidence > 0.9
    assert beside.ambiguous
    assert beside.confidence <= 0.7


def test_a_pose_at_which_nothing_meets_is_no_rival():
    told = with_contrast([scored(0, 0.8), scored(1, 0.7, coverage=0.001)])[0].evidence
    assert told.contrast == MAX_CONTRAST


@pytest.mark.parametrize("place", [None, (0.0, 0.0, 0.0)])
def test_a_pose_far_ahead_of_all_others_is_accepted_where_noise_blurs_the_shape(place):
    """Two views of a blade: 94 % of the points fit, at no other pose more than 28 %."""
    views = [scan(*np.radians((azimuth, 17, 0)), seed=k) for k, azimuth in enumerate((-60, -110))]
    (source, T_source), (target, T_target) = views
    options = RegistrationOptions(source_viewpoint=place, target_viewpoint=place)
    found = register(source, target, options)
    truth = T_target @ inverse(T_source)
    assert rotation_error(found.T_target_source[:3, :3], truth[:3, :3]) < 1
    assert found.accepted
    assert {each.code for each in found.warnings} <= {"viewpoints_inferred"}
