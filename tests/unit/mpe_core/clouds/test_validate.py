"""Which clouds are valid, and what is said about the others."""

import numpy as np
import pytest

from mpe_core.clouds.validate import validate_cloud
from mpe_core.errors import (
    CloudShapeError,
    CoordinateRangeError,
    DegenerateCloudError,
    TooFewPointsError,
)

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
    cloud = validate_cloud(given)
    assert cloud.points.dtype == np.float64
    assert cloud.points.flags.c_contiguous
    np.testing.assert_array_equal(cloud.points, TETRAHEDRON)
    np.testing.assert_array_equal(cloud.original_index(np.arange(4)), [0, 1, 2, 3])
    assert cloud.dropped_rows == 0


def test_rows_that_are_not_finite_are_dropped_and_the_others_keep_their_rows():
    rows = np.vstack([[np.nan, 0, 0], TETRAHEDRON[:2], [0, np.inf, 0], TETRAHEDRON[2:]])
    before = rows.copy()
    cloud = validate_cloud(rows)
    assert cloud.dropped_rows == 2
    np.testing.assert_array_equal(cloud.original_index(np.arange(4)), [1, 2, 4, 5])
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
        (1e-160 * np.random.default_rng(0).normal(size=(9, 3)), DegenerateCloudError, "one place"),
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
        validate_cloud(given, "source")
    assert str(caught.value).startswith(("source", "all points of source"))


def test_flat_and_thin_clouds_are_no_lines():
    assert len(validate_cloud([[0, 0, 0], [1, 0, 0], [0, 1, 0]]).points) == 3
    assert len(validate_cloud([[0, 0, 0], [1000, 0, 0], [500, 0.01, 0]]).points) == 3


@pytest.mark.parametrize("size", [1e-12, 1.0, 1e12])
def test_the_size_of_the_unit_does_not_matter(size):
    np.testing.assert_allclose(validate_cloud(TETRAHEDRON * size).points, TETRAHEDRON * size)
