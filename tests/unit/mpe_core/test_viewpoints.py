"""Registration of clouds that were merged from several scans, with the place of each."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from mpe_core import RegistrationOptions, register
from mpe_core.clouds.validate import validate_cloud
from mpe_core.geometry.rigid import apply, inverse
from mpe_core.progress import Progress
from mpe_core.rigid_registration import search_mirrored, search_trial
from mpe_core.scale_search import MIRROR_LEVELS
from tests.factories.checks import assert_pose_close
from tests.factories.clouds import Array, motion, random_rotation, sheet
from tests.factories.worlds import ROOM, rooms, scan_rooms


@dataclass(frozen=True)
class Case:
    """Two clouds in frames of their own, each merged from the scans of two rooms."""

    source: Array
    target: Array
    source_viewpoint: Array
    target_viewpoint: Array
    truth: Array

    @property
    def options(self) -> RegistrationOptions:
        """All places of both."""
        return RegistrationOptions(
            source_viewpoint=self.source_viewpoint, target_viewpoint=self.target_viewpoint
        )

    def moved(self, seed: int) -> Case:
        """Turn and move the source, with the places of its scanners."""
        rng = np.random.default_rng(seed)
        away = motion(self.source, random_rotation(rng), rng)
        return replace(
            self,
            source=apply(away, self.source),
            source_viewpoint=apply(away, self.source_viewpoint),
            truth=self.truth @ inverse(away),
        )


@pytest.fixture(scope="module")
def case() -> Case:
    rng = np.random.default_rng(5)
    world = rooms(rng, 2)
    source, target = (scan_rooms(world, rng, range(2)) for _ in range(2))
    still = Case(source.points, target.points, source.viewpoints, target.viewpoints, np.eye(4))
    return still.moved(6)


def bits(found) -> list[object]:
    return [found.T_target_source.tobytes(), found.confidence, found.covariance.tobytes()]


def test_order_and_copies_of_the_places_change_nothing(case):
    shuffled = replace(
        case.options,
        source_viewpoint=case.source_viewpoint[[1, 0, 1]],
        target_viewpoint=case.target_viewpoint[::-1],
    )
    first, second = (
        register(case.source, case.target, options) for options in (case.options, shuffled)
    )
    assert bits(first) == bits(second)
    assert first.accepted
    assert_pose_close(first.T_target_source, case.truth, case.source, degrees=0.5, shift=0.01)


def test_a_list_of_one_place_is_that_place(case):
    one = RegistrationOptions(source_viewpoint=(1, 2, 3), target_viewpoint=[4, 5, 6])
    assert one == RegistrationOptions(source_viewpoint=[(1, 2, 3)], target_viewpoint=[[4, 5, 6]])
    assert one.source_viewpoint == (1.0, 2.0, 3.0)


def test_the_answer_moves_with_the_source_and_its_places(case):
    again = case.moved(7)
    first, second = (register(each.source, each.target, each.options) for each in (case, again))
    assert_pose_close(second.T_target_source, again.truth, again.source, degrees=0.3, shift=0.005)
    assert second.confidence == pytest.approx(first.confidence, abs=0.02)


def test_places_left_behind_refuse_the_pose(case):
    """Had their motion no effect, the laws above would say nothing."""
    again = case.moved(7)
    elsewhere = again.source_viewpoint + np.array([0, 0, ROOM[0]])
    options = replace(again.options, source_viewpoint=elsewhere)
    wrong = register(again.source, again.target, options)
    right = register(again.source, again.target, again.options)
    assert wrong.confidence < right.confidence


def test_both_orders_of_a_pair_have_one_pose(case):
    there = register(case.source, case.target, case.options)
    swapped = RegistrationOptions(
        source_viewpoint=case.target_viewpoint, target_viewpoint=case.source_viewpoint
    )
    back = register(case.target, case.source, swapped)
    assert_pose_close(
        inverse(back.T_target_source), there.T_target_source, case.source, degrees=0.3, shift=0.005
    )
    assert back.confidence == pytest.approx(there.confidence, abs=0.05)


def test_the_places_are_scaled_with_the_source(case):
    """In millimetres, cloud and places alike."""
    at_scale = replace(case.options, source_viewpoint=1000 * case.source_viewpoint, scale="units")
    found = register(1000 * case.source, case.target, at_scale)
    plain = register(case.source, case.target, case.options)
    assert found.scale == pytest.approx(0.001)
    assert found.confidence == pytest.approx(plain.confidence, abs=0.02)
    S = np.diag([1000.0, 1000, 1000, 1])
    assert_pose_close(
        found.T_target_source @ S, plain.T_target_source, case.source, degrees=0.1, shift=0.002
    )


def test_a_mirrored_source_is_searched_with_its_places_mirrored(case):
    """Both searches see the same scene, thinned on other grids."""
    flip = np.array([-1.0, 1, 1])
    options = replace(case.options, source_viewpoint=flip * case.source_viewpoint)
    plain, mirrored = (
        search_trial(
            *map(validate_cloud, (cloud, case.target)), known, Progress(None), MIRROR_LEVELS
        )
        for cloud, known in ((case.source, case.options), (flip * case.source, options))
    )
    found = search_mirrored(mirrored, options, Progress(None), MIRROR_LEVELS)
    assert found.best.evidence.confidence == pytest.approx(plain.best.evidence.confidence, abs=0.02)
    assert found.best.evidence.free_space_violation < 0.05
    assert mirrored.best.evidence.confidence < found.best.evidence.confidence
    assert_pose_close(
        found.T_target_source, plain.T_target_source, case.source, degrees=0.5, shift=0.01
    )


def test_places_before_a_thin_part_settle_its_flip():
    rng = np.random.default_rng(0)
    target, source = sheet(rng), sheet(rng)
    before, others = np.array([[0, -1.0, 3], [0, 1, 3]]), np.array([[-1.0, 0, 3], [1, 0, 2]])
    away = motion(source, random_rotation(rng), rng)
    source = apply(away, source)
    options = RegistrationOptions(
        source_viewpoint=apply(away, before), target_viewpoint=others, infer_viewpoints="never"
    )
    found = register(source, target, options)
    assert register(source, target).ambiguous
    assert not found.ambiguous
    assert_pose_close(found.T_target_source, inverse(away), source, degrees=1, shift=0.01)
