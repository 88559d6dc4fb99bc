"""The parts of the confidence benchmark that its figures hang on."""

import numpy as np
import pytest

pytest.importorskip("matplotlib")
from benchmarks.confidence import roc_area
from benchmarks.impossible import impossible_pairs


def test_roc_area_of_known_scores():
    right = np.array([True, True, False, False])
    assert roc_area(np.array([4.0, 3.0, 2.0, 1.0]), right) == 1
    assert roc_area(np.array([1.0, 2.0, 3.0, 4.0]), right) == 0
    assert roc_area(np.array([1.0, 1.0, 1.0, 1.0]), right) == 0.5
    assert roc_area(np.array([4.0, 2.0, 3.0, 1.0]), right) == 0.75


def test_impossible_pairs_are_the_same_each_time_and_of_one_size(data):
    first, again = list(impossible_pairs(6)), list(impossible_pairs(6))
    assert len({name for name, _, _ in first}) == 6
    for (name, source, target), (other, x, y) in zip(first, again, strict=True):
        assert name == other
        np.testing.assert_array_equal(source, x)
        np.testing.assert_array_equal(target, y)
        extents = [np.linalg.norm(cloud.max(axis=0) - cloud.mean(axis=0)) for cloud in (x, y)]
        assert 0.2 < extents[0] / extents[1] < 5
