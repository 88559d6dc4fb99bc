"""The order by buckets against a stable sort."""

import numpy as np
import pytest

from mpe_core.kernels.buckets import BUCKET_COUNT, PILLAR_BITS, bucket_of, partition

ORIGIN, EDGE = np.float32([-1, -1, -1]), np.float32(0.05)


@pytest.mark.parametrize("count", [1, 100, 20_000])
def test_partition_is_a_stable_sort_by_bucket(count):
    points = np.random.default_rng(count).uniform(-1, 1, (count, 3)).astype(np.float32)
    out, rows = np.empty_like(points), np.empty(count, np.int32)
    bounds = partition(points, (ORIGIN, EDGE), out, rows)
    bucket = np.array([bucket_of(x, y, ORIGIN, 1 / EDGE) for x, y, _ in points])
    np.testing.assert_array_equal(rows, np.argsort(bucket, kind="stable"))
    np.testing.assert_array_equal(out, points[rows])
    counts = np.bincount(bucket, minlength=BUCKET_COUNT)
    np.testing.assert_array_equal(bounds, np.concatenate([[0], np.cumsum(counts)]))


def test_a_pillar_of_cells_is_in_one_bucket():
    side = EDGE * 2**PILLAR_BITS
    inside = np.random.default_rng(1).uniform(0, 1, (200, 2)) * side * 0.999
    for corner in ((0, 0), (3, 5), (7, 1)):
        places = ORIGIN[:2] + side * np.array(corner) + inside
        assert (
            len({bucket_of(*place, ORIGIN, 1 / EDGE) for place in places.astype(np.float32)}) == 1
        )
