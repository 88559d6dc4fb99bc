"""Evidence for right and wrong poses, and the confidence that follows from it."""

import numpy as np
import pytest

from mpe_core import RegistrationOptions
from mpe_core.assess.confidence import Evidence
from mpe_core.clouds.preprocess import prepare_cloud
from mpe_core.geometry.rigid import axis_rotation, pose
from mpe_core.pipeline import PosePipeline
from mpe_core.search.pose_prior import PosePrior
from tests.factories.clouds import knot

WRONG = pose(axis_rotation(np.array([1.0, 2, 3]), 1.5), np.array([0.1, 0, 0.2]))


@pytest.fixture(scope="module")
def scorer():
    source, target = (
        prepare_cloud(2 * knot(20_000, np.random.default_rng(seed)) - [1.1, 0.3, 0.2])
        for seed in (0, 1)
    )
    return PosePipeline(source, target, PosePrior(), RegistrationOptions())


def test_at_the_right_pose_all_points_lie_on_the_surface(scorer):
    evidence = scorer.score(np.eye(4))
    assert evidence.coverage > 0.98
    assert evidence.on_surface_fraction > 0.9
    assert evidence.surface_agreement > 0.9
    assert evidence.accepted


def test_at_a_wrong_pose_the_overlapping_points_do_not(scorer):
    evidence = scorer.score(WRONG)
    assert evidence.surface_agreement < 0.5
    assert not evidence.accepted
    assert evidence.sort_key < scorer.score(np.eye(4)).sort_key


def test_where_nothing_overlaps_the_evidence_is_zero(scorer):
    evidence = scorer.score(pose(np.eye(3), np.full(3, 9.0)))
    shares = evidence.coverage, evidence.on_surface_fraction, evidence.surface_agreement
    assert shares == (0, 0, 0)
    assert evidence.confidence < 1e-5


def test_more_coverage_and_agreement_give_more_confidence():
    def confidence(coverage, agreement, **more):
        return Evidence(coverage, agreement, agreement, **more).confidence

    assert confidence(0.5, 0.7) < confidence(0.9, 0.7) < confidence(0.9, 0.9)
    assert confidence(0.4, 0.8, overlap=0.5) == confidence(0.8, 0.8)
    assert confidence(0.4, 0.8, overlap=0.2) == confidence(1.0, 0.8), "at most all of them"
