"""What is left after a ring of poses."""

import numpy as np
import pytest

pytest.importorskip("matplotlib")
from benchmarks.closure import closure, triangles
from mpe_core.geometry.rigid import inverse
from tests.factories.clouds import axis_rotation, random_rotation


@pytest.fixture
def poses():
    """Between four clouds of which a and d are no pair."""
    rng = np.random.default_rng(0)
    frames = {}
    for name in "abcd":
        frames[name] = np.eye(4)
        frames[name][:3, :3], frames[name][:3, 3] = random_rotation(rng), rng.normal(size=3)
    ends = [(a, b) for a in "abcd" for b in "abcd" if a != b and {a, b} != {"a", "d"}]
    return {(a, b): inverse(frames[b]) @ frames[a] for a, b in ends}


def test_triangles_are_those_of_which_each_two_are_a_pair(poses):
    assert [sorted(ring) for ring in triangles(poses)] == [["a", "b", "c"], ["b", "c", "d"]]


def test_right_poses_close_and_a_wrong_one_leaves_its_error(poses):
    for ring in triangles(poses):
        assert closure(poses, ring) < 1e-6
    turn = np.eye(4)
    turn[:3, :3] = axis_rotation(np.array([1.0, 2.0, 3.0]), np.radians(1.5))
    wrong = poses | {("a", "b"): turn @ poses["a", "b"]}
    assert closure(wrong, ("a", "b", "c")) == pytest.approx(1.5)
    assert closure(wrong, ("b", "c", "d")) < 1e-6
