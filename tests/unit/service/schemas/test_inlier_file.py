"""The file of the inlier pairs: NPY, read without a parser."""

from __future__ import annotations

import errno
import io
from pathlib import Path

import numpy as np
import pytest

from mpe_core.result import Inliers
from service.problems import is_disk_full
from service.schemas.inlier_file import INLIER_DTYPE, header_of, read_inliers, write_inliers


def pairs(count: int) -> Inliers:
    number = np.arange(count)
    return Inliers(number, number[::-1], number / 7, threshold=1.0)


@pytest.mark.parametrize("count", [0, 3, 1000])
def test_pairs_are_read_as_they_were_written_by_numpy_too(tmp_path: Path, count: int) -> None:
    path = tmp_path / "pairs.npy"
    write_inliers(path, pairs(count))
    rows = read_inliers(path)
    assert rows.dtype == INLIER_DTYPE
    np.testing.assert_array_equal(rows["source"], np.arange(count))
    np.testing.assert_array_equal(rows["target"], np.arange(count)[::-1])
    np.testing.assert_array_equal(rows["distance"], np.arange(count) / 7)
    np.testing.assert_array_equal(np.load(path, allow_pickle=False), rows)


@pytest.mark.parametrize("count", [0, 1, 10**9])
def test_the_header_is_that_of_numpy_and_of_one_length(count: int) -> None:
    assert len(header_of(count)) == len(header_of(0))
    if count < 10:
        np.save(buffer := io.BytesIO(), np.zeros(count, INLIER_DTYPE))
        assert buffer.getvalue().startswith(header_of(count))


def saved(array: np.ndarray) -> bytes:
    np.save(buffer := io.BytesIO(), array)
    return buffer.getvalue()


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\x93NUMPY\x01\x00",
        saved(np.zeros(3, INLIER_DTYPE))[:-1],
        saved(np.zeros(3, INLIER_DTYPE)) + b"\x00" * 24,
        saved(np.zeros((3, 3))),
        saved(np.zeros(72, np.uint8)),
        b"\x93NUMPY\x01\x00\xb6\x00" + b"(" * 182 + b"\x00" * 72,
    ],
    ids=["empty", "short", "cut", "longer", "other", "bytes", "nested"],
)
def test_anything_else_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "pairs.npy").write_bytes(content)
    with pytest.raises(ValueError, match="not as it was written"):
        read_inliers(tmp_path / "pairs.npy")


def test_a_full_disk_is_told(tmp_path: Path) -> None:
    (tmp_path / "pairs.npy").symlink_to("/dev/full")
    with pytest.raises(OSError, match="space") as full:
        write_inliers(tmp_path / "pairs.npy", pairs(5))
    assert full.value.errno == errno.ENOSPC
    assert is_disk_full(full.value)
