"""Views of cartons and rooms, which fit on themselves turned by quarters and halves."""

import pytest

pytest.importorskip("open3d")

from benchmarks.recall import is_right
from benchmarks.worlds.pairs import world_pair
from mpe_core import register
from mpe_core.pipeline import PosePipeline
from tests.factories.checks import pose_error


def outcome(number):
    """Whether the pose of two views of cartons is right, and whether it is given for sure."""
    pair = world_pair("cartons", number)
    found = register(pair.source, pair.target)
    tolerance = {
        "max_rotation_deg": pair.max_rotation_deg,
        "max_translation": pair.max_translation,
    }
    errors = pose_error(found.T_target_source, pair.T_target_source, pair.source)
    return is_right(tolerance, *errors), found.accepted and not found.ambiguous


@pytest.mark.parametrize("number", [1504, 1506])
def test_a_quarter_turn_of_cartons_is_not_given_for_sure(number, monkeypatch):
    right, sure = outcome(number)
    assert right or not sure
    monkeypatch.setattr(PosePipeline, "_may_be_turned", lambda *_: False)
    assert outcome(number) == (False, True)  # what the turned poses are compared for


def test_cartons_that_one_pose_fits_alone_are_registered():
    assert outcome(1500) == (True, True)
