"""Motions in words: for any basis of the same directions, and in the caller's axes."""

from __future__ import annotations

import numpy as np
import pytest

from mpe_core import register
from mpe_core.assess.motion_words import (
    describe_alternatives,
    describe_free_directions,
    name_direction,
)
from mpe_core.geometry.rigid import axis_rotation, pose
from tests.factories.clouds import random_rotation

X, Y, Z = np.eye(3)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(4)


SLIDE, TURN = np.hstack([np.zeros((3, 3)), np.eye(3)]), np.hstack([np.eye(3), np.zeros((3, 3))])


@pytest.mark.parametrize(
    ("directions", "words"),
    [
        (SLIDE[:1], "slides along x"),
        ([*SLIDE[:2], TURN[2]], "slides across z and turns about z"),
        ([SLIDE[1], TURN[1]], "slides along y and turns about y"),
        (TURN, "turns about any axis"),
        ([*SLIDE, TURN[0]], "slides in any direction and turns about x"),
        (TURN[1:], "turns about axes across x"),
    ],
)
def test_any_basis_of_a_space_has_the_same_words(rng, directions, words):
    directions = np.asarray(directions)
    mixing = np.linalg.qr(rng.normal(size=(len(directions),) * 2))[0]
    assert describe_free_directions(mixing @ directions) == words


@pytest.mark.parametrize(
    ("direction", "name"),
    [(-2 * Z, "z"), ([0.02, 3, 0.1], "y"), ([-1, -1, 0], "(0.71, 0.71, 0.00)")],
)
def test_names_of_directions(direction, name):
    assert name_direction(np.asarray(direction, float)) == name


def test_alternatives_are_told_by_the_least_shift_and_turn(rng):
    T = pose(random_rotation(rng), rng.normal(size=3))
    shifts = [pose(np.eye(3), s * X) for s in (6.0, -3.0)]
    quarter, half = (pose(axis_rotation(Z, np.radians(a)), 40 * Y) for a in (90, 180))
    said = describe_alternatives(T, np.array([*shifts, half, quarter]) @ T, rng.normal(size=3))
    assert said == "shifted by 3 along x or turned by 90 degrees about z"


def test_a_floor_slides_in_its_plane(rng):
    floor = np.column_stack([rng.uniform(-1, 1, (4000, 2)), rng.normal(0, 1e-3, 4000)])
    found = register(floor, floor[:, [2, 0, 1]])
    said = {warning.code: str(warning) for warning in found.warnings}["free_directions"]
    assert "the source slides across x and turns about x" in said
    assert said.endswith("not accepted: one plane is all that both show")
    assert not found.accepted
    assert found.confidence < 0.5


def test_what_slides_in_one_direction_alone_is_accepted(rng):
    angle, along = rng.uniform(0, 2 * np.pi, 4000), rng.uniform(-1, 1, 4000)
    tube = np.column_stack([0.3 * np.cos(angle), 0.3 * np.sin(angle), along])
    tube += rng.normal(0, 1e-3, tube.shape)
    found = register(tube, tube[:, [2, 0, 1]])
    assert found.accepted
    assert len(found.free_directions) == 2
