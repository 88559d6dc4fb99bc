"""Files that a registration leaves."""

from __future__ import annotations

import errno
from pathlib import Path

import numpy as np
import pytest

from mpe_core.result import Inliers
from service.problems import is_disk_full
from service.schemas.serialize_result import inlier_array
from service.workers.register_clouds import write_rows


@pytest.mark.parametrize("count", [0, 3])
def test_rows_are_read_as_they_were_written(tmp_path: Path, count: int) -> None:
    number = np.arange(count)
    rows = inlier_array(Inliers(number, number[::-1], number / 7, threshold=1.0))
    write_rows(tmp_path / "rows.npy", rows)
    read = np.load(tmp_path / "rows.npy", allow_pickle=False)
    assert read.dtype == rows.dtype
    np.testing.assert_array_equal(read, rows)


def test_a_full_disk_is_told(tmp_path: Path) -> None:
    (tmp_path / "rows.npy").symlink_to("/dev/full")
    with pytest.raises(OSError, match="space") as full:
        write_rows(tmp_path / "rows.npy", np.zeros(5, [("source", "<u4"), ("distance", "<f8")]))
    assert full.value.errno == errno.ENOSPC
    assert is_disk_full(full.value)
