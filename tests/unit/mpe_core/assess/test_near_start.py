"""Of poses that fit as well, the one nearest to the start comes first."""

from dataclasses import dataclass

import numpy as np
import pytest

from mpe_core import RegistrationOptions, register
from mpe_core.assess.confidence import Evidence
from mpe_core.assess.near_start import prefer_near_start
from mpe_core.geometry.rigid import apply, axis_rotation, pose, rotation_error
from tests.factories.checks import assert_pose_close
from tests.factories.clouds import knot, moved, random_rotation
from tests.factories.parts import comb


@dataclass(frozen=True)
class Scored:
    evidence: Evidence
    away: float


def scored(agreement, away, on_surface=0.9):
    return Scored(Evidence(1.0, on_surface, agreement), away)


def first(*poses):
    return prefer_near_start(poses, lambda pose: pose.away)[0]


def test_the_near_one_wins_unless_it_fits_worse():
    far, near = scored(0.95, 1.0), scored(0.9, 0.1, on_surface=0.5)
    assert first(far, near) is near
    assert first(far, scored(0.8, 0.1)) is far
    assert first(far, scored(0.9, 0.6)) is far
    best = scored(1.0, 0.1)
    assert first(far, best) is best
    refused = scored(0.3, 1.0)
    assert first(refused, scored(0.25, 0.0)) is refused


@pytest.mark.parametrize("seed", range(3))
def test_the_truth_as_start_is_not_left_for_another_bay(seed):
    rng = np.random.default_rng(seed)
    target, there = comb(rng, 0), comb(rng, 4)
    truth = pose(random_rotation(rng), rng.uniform(-5, 5, 3))
    source = (there - truth[:3, 3]) @ truth[:3, :3]
    found = register(source, target, RegistrationOptions(initial_transform=truth))
    assert_pose_close(found.T_target_source, truth, source, degrees=1, shift=0.3)


def test_the_search_keeps_within_the_given_range():
    rng = np.random.default_rng(0)
    trial = moved(knot(3000, rng), rng, largest_deg=10)
    centre = apply(trial.T_target_source, trial.source).mean(axis=0)
    R = axis_rotation(rng.normal(size=3), np.radians(100))
    turned = pose(R, centre - R @ centre) @ trial.T_target_source
    wide = RegistrationOptions(initial_transform=turned, max_rotation_deg=120, max_translation=1.0)
    found = register(trial.source, trial.target, wide)
    assert_pose_close(
        found.T_target_source, trial.T_target_source, trial.source, degrees=0.5, shift=0.01
    )
    narrow = RegistrationOptions(initial_transform=turned, max_rotation_deg=20)
    found = register(trial.source, trial.target, narrow)
    assert rotation_error(found.T_target_source, turned) <= 20
    assert not found.accepted
