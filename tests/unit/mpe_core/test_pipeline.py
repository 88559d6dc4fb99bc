"""Levels of the search, preselection, and poses that fit as well as the best."""

import numpy as np
import pytest

from mpe_core import RegistrationOptions, pipeline
from mpe_core.assess.confidence import Evidence
from mpe_core.assess.rivals import ScoredPose, select_equal
from mpe_core.clouds.preprocess import prepare_cloud
from mpe_core.geometry.rigid import apply, axis_rotation, inverse, pose, rotation_error
from mpe_core.pipeline import PosePipeline
from mpe_core.progress import Progress
from mpe_core.refine.minimum import Minimum
from mpe_core.search.candidate_search import CandidateSearch
from mpe_core.search.levelled_effort import QUICK_LEVELLED
from mpe_core.search.pose_prior import PosePrior
from mpe_core.search.pose_search import SEARCH_LEVELS
from tests.factories.clouds import knot
from tests.factories.worlds import scan_world, street

TRUTH = pose(axis_rotation(np.array([1.0, 2, 3]), 2.0), np.array([0.1, 0.2, 0.0]))


@pytest.fixture(scope="module")
def steps():
    source, target = (
        2 * knot(20_000, np.random.default_rng(seed)) - [1.1, 0.3, 0.2] for seed in (0, 1)
    )
    return PosePipeline(
        prepare_cloud(apply(inverse(TRUTH), source)),
        prepare_cloud(target),
        PosePrior(),
        RegistrationOptions(),
    )


def levels_searched(steps, monkeypatch, confidence):
    levels = []
    monkeypatch.setattr(
        PosePipeline,
        "refine",
        lambda self, T: ScoredPose(Minimum(T, True, 1), Evidence(*3 * [confidence])),
    )
    search = CandidateSearch.find

    def find(self, level, report):
        levels.append(level)
        return search(self, SEARCH_LEVELS[0], report)

    monkeypatch.setattr(CandidateSearch, "find", find)
    steps.run(Progress(None))
    return levels


def test_the_pose_is_found_by_the_first_level(steps):
    best, *others = steps.run(Progress(None))
    assert rotation_error(best.minimum.T, TRUTH) < 0.2
    assert best.evidence.accepted
    assert not others


def test_a_pose_on_its_way_is_measured_at_its_minimum(steps):
    poses = steps.run(Progress(None))
    reached = steps.refiner.refine_all(TRUTH[None])[0]
    turned = pose(axis_rotation(np.array([0, 0, 1.0]), np.radians(12)), np.zeros(3)) @ TRUTH
    early = ScoredPose(Minimum(turned, False, 3), poses[0].evidence)
    finished = steps.finish(early)
    assert rotation_error(finished.minimum.T, reached.T) < 0.5
    assert finished.evidence is not early.evidence
    assert finished.evidence.contrast is None
    assert finished.evidence.on_surface_fraction == pytest.approx(
        poses[0].evidence.on_surface_fraction, abs=0.02
    )


def test_a_pose_that_convinces_ends_the_search(steps, monkeypatch):
    assert levels_searched(steps, monkeypatch, 1.0) == [SEARCH_LEVELS[0]]


def test_without_one_all_levels_are_searched(steps, monkeypatch):
    assert levels_searched(steps, monkeypatch, 0.0) == list(SEARCH_LEVELS)


def scored(degrees, agreement):
    T = pose(axis_rotation(np.array([0.0, 0, 1]), np.radians(degrees)), np.zeros(3))
    return ScoredPose(Minimum(T, True, 1), Evidence(1.0, agreement, agreement))


def test_poses_that_fit_as_well_and_differ_are_kept():
    best = scored(0, 0.95)
    ordered = [best, scored(1, 0.94), scored(90, 0.93), scored(180, 0.6)]
    assert select_equal(ordered) == [best, ordered[2]]


def test_a_pose_that_is_not_accepted_has_no_equals():
    ordered = [scored(0, 0.2), scored(90, 0.2)]
    assert select_equal(ordered) == ordered[:1]


def test_preselection_keeps_the_right_pose(steps):
    rng = np.random.default_rng(2)
    poses = [
        pose(axis_rotation(rng.normal(size=3), angle), np.zeros(3)) @ TRUTH
        for angle in rng.uniform(0.7, 3, 15)
    ]
    poses.insert(11, pose(axis_rotation(np.ones(3), 0.05), np.zeros(3)) @ TRUTH)
    found = steps._preselect(np.array(poses), [], lambda fraction: None)
    assert len(found) == pipeline.MAX_REFINED
    assert found[0].row == 11
    assert found[0].weak_evidence is None  # and is refined fully


def test_a_candidate_that_falls_short_stays_a_rival_as_it_is(steps):
    poses = np.array([TRUTH, pose(axis_rotation(np.ones(3), 2.0), np.zeros(3)) @ TRUTH])
    right, wrong = steps._preselect(poses, [], lambda fraction: None)
    assert (right.row, wrong.row) == (0, 1)
    (kept,) = steps._refine_preselected([wrong])
    np.testing.assert_array_equal(kept.minimum.T, wrong.T)
    assert not kept.minimum.converged
    first, second = steps.compare([steps.refine(right.T), kept])
    assert first.evidence.contrast > pipeline.MAX_SCORE_GAP
    assert second.evidence.contrast < -pipeline.MAX_SCORE_GAP


def test_a_candidate_that_falls_short_of_a_known_pose_stays_as_it_is(steps):
    wrong = pose(axis_rotation(np.ones(3), 2.0), np.zeros(3)) @ TRUTH
    (alone,) = steps._preselect(wrong[None], [], lambda fraction: None)
    assert alone.weak_evidence is None
    known = [steps.refine(TRUTH)]
    (beside,) = steps._preselect(wrong[None], known, lambda fraction: None)
    assert beside.weak_evidence is not None


def street_steps(prior=None, stray=0.0):
    rng = np.random.default_rng(0)
    world = street(rng)
    clouds = [scan_world(world, np.array([x, 0.5, 1.8]), rng).points / 30 for x in (3.0, -3.0)]
    far = np.array([[stray, 0, 0], [-stray, 0, 0]])
    source, target = (
        prepare_cloud(np.vstack([cloud, far]) if stray else cloud) for cloud in clouds
    )
    return PosePipeline(source, target, prior or PosePrior(), RegistrationOptions())


def find_levelled(steps):
    return steps.search.find_levelled(steps.judge.levelled, QUICK_LEVELLED, lambda share: None)


def test_levelled_poses_are_those_that_the_prior_accepts():
    free = street_steps()
    assert len(find_levelled(free).poses)
    upside_down = street_steps(PosePrior(initial=np.diag([1.0, -1.0, -1.0, 1.0])))
    assert upside_down.judge.levelled is None  # near a start there is no search
    found = upside_down.search.find_levelled(
        free.judge.levelled, QUICK_LEVELLED, lambda share: None
    )
    assert not len(found.poses)
    assert len(upside_down.run(Progress(None)))


def test_stray_points_do_not_widen_the_view_from_above():
    found = find_levelled(street_steps(stray=1e5))
    moved = [pose[:3, 3] for pose in found.poses[:4]]
    assert min(np.linalg.norm(t - np.array([0.2, 0, 0])) for t in moved) < 0.05
