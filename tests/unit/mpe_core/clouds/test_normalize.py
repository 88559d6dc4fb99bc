"""What the door lets in, and what it says to the rest."""

import numpy as np
import pytest

from mpe_core.clouds.normalize import as_pair, as_points
from mpe_core.errors import (
    CloudShapeError,
    CoordinateRangeError,
    DegenerateCloudError,
    TooFewPointsError,
)
from mpe_core.geometry.rigid import apply, axis_rotation, pose

TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])


@pytest.mark.parametrize(
    "given",
    [
        TETRAHEDRON.tolist(),
        TETRAHEDRON.astype(np.int16),
        TETRAHEDRON.astype(np.uint8),
        TETRAHEDRON.astype(np.float16),
        TETRAHEDRON.astype(">f4"),
        np.asfortranarray(TETRAHEDRON, np.float64),
        np.repeat(np.repeat(TETRAHEDRON, 2, axis=0), 3, axis=1)[::2, ::3],
        TETRAHEDRON[::-1][::-1],
    ],
)
def test_any_real_array_gives_the_same_points(given):
    cloud = as_points(given)
    assert cloud.points.dtype == np.float64
    assert cloud.points.flags.c_contiguous
    np.testing.assert_array_equal(cloud.points, TETRAHEDRON)
    np.testing.assert_array_equal(cloud.given(np.arange(4)), [0, 1, 2, 3])
    assert cloud.dropped == 0


def test_rows_that_are_not_finite_are_dropped_and_the_others_keep_their_rows():
    rows = np.vstack([[np.nan, 0, 0], TETRAHEDRON[:2], [0, np.inf, 0], TETRAHEDRON[2:]])
    before = rows.copy()
    cloud = as_points(rows)
    assert cloud.dropped == 2
    np.testing.assert_array_equal(cloud.given(np.arange(4)), [1, 2, 4, 5])
    np.testing.assert_array_equal(cloud.points, TETRAHEDRON)
    np.testing.assert_array_equal(rows, before)


@pytest.mark.parametrize(
    ("given", "error", "says"),
    [
        ([], TooFewPointsError, "empty"),
        (np.empty((0, 3)), TooFewPointsError, "got 0 of 0"),
        (TETRAHEDRON[:2], TooFewPointsError, "got 2 of 2"),
        (np.full((9, 3), np.nan), TooFewPointsError, "got 0 of 9"),
        (TETRAHEDRON[0], CloudShapeError, r"\(3,\)"),
        (TETRAHEDRON[:, :2], CloudShapeError, r"\(4, 2\)"),
        (np.zeros((2, 4, 3)), CloudShapeError, r"\(2, 4, 3\)"),
        (TETRAHEDRON.astype(str), CloudShapeError, "dtype"),
        (TETRAHEDRON.astype(complex), CloudShapeError, "complex"),
        (TETRAHEDRON.astype(object), CloudShapeError, "object"),
        ([[1, 2, 3], [1, 2]], CloudShapeError, "unequal"),
        (None, CloudShapeError, "dtype"),
        (TETRAHEDRON * 1e30, CoordinateRangeError, r"1e\+30 in row 1"),
        (np.vstack([TETRAHEDRON, [[0, 0, -1e30]]]), CoordinateRangeError, "row 4"),
        (np.ones((5, 3)), DegenerateCloudError, "one place"),
        (np.full((5, 3), 4e6), DegenerateCloudError, "one place"),
        (np.outer(np.arange(9), [1, 2, 3]), DegenerateCloudError, "one line"),
        (4e6 + np.outer(np.arange(9), [0.1, 0.2, 0.3]), DegenerateCloudError, "one line"),
        (np.full((9999, 3), 0.1), DegenerateCloudError, "one place"),
        (0.1 + np.outer(np.arange(9999), [1, 2, 3]), DegenerateCloudError, "one line"),
        (4e6 + np.outer(np.arange(9999), [1e-5, 2e-5, 3e-5]), DegenerateCloudError, "one line"),
    ],
)
def test_bad_clouds_are_refused_with_a_reason(given, error, says):
    with pytest.raises(error, match=says) as caught:
        as_points(given, "source")
    assert str(caught.value).startswith(("source", "all points of source"))


def test_flat_and_thin_clouds_are_no_lines():
    assert len(as_points([[0, 0, 0], [1, 0, 0], [0, 1, 0]]).points) == 3
    assert len(as_points([[0, 0, 0], [1000, 0, 0], [500, 0.01, 0]]).points) == 3


@pytest.mark.parametrize("size", [1e-12, 1.0, 1e12])
def test_the_size_of_the_unit_does_not_matter(size):
    np.testing.assert_allclose(as_points(TETRAHEDRON * size).points, TETRAHEDRON * size)


def test_a_pose_between_centred_clouds_becomes_the_callers():
    rng = np.random.default_rng(1)
    x = rng.normal(size=(50, 3)) * 20 + [5e5, 4e6, 100]
    truth = pose(axis_rotation(np.array([1.0, 2, 3]), 1.0), np.array([10.0, -2e5, 30]))
    y = apply(truth, x)
    pair = as_pair(as_points(x), as_points(y))
    np.testing.assert_allclose(np.abs(pair.source).max(), 1, atol=0.5)
    np.testing.assert_allclose(
        apply(pair.to_caller(pose(truth[:3, :3], np.zeros(3))), x), y, atol=1e-7
    )


def test_stray_points_do_not_set_the_unit():
    x = np.random.default_rng(2).normal(size=(1000, 3))
    with_stray = np.vstack([x, [[500, 0, 0]]])
    clean, stray = (as_pair(as_points(c), as_points(x)).unit for c in (x, with_stray))
    assert stray == pytest.approx(clean, rel=0.05)
