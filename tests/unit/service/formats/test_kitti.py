"""KITTI rows are read only if declared."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from service.formats import MalformedFileError, UnknownFormatError, read_points
from tests.factories.cloud_files import POINTS
from tests.factories.decoding import write_file
from tests.factories.scanner_files import kitti


@pytest.mark.real_data
def test_kitti_rows_are_read_if_declared(data: Path) -> None:
    path = data / "formats/kitti_velodyne.bin"
    with pytest.raises(UnknownFormatError):
        read_points(path)
    points = read_points(path, format="kitti").points
    assert points.shape == (20_000, 3)
    distance = np.linalg.norm(points, axis=1)
    assert 1 < distance.min() < distance.max() < 130  # the range of the Velodyne HDL-64E, metres


def test_kitti(tmp_path: Path) -> None:
    np.testing.assert_array_equal(
        read_points(write_file(tmp_path, kitti()), format="kitti").points, POINTS
    )
    with pytest.raises(MalformedFileError, match="639 bytes"):
        read_points(write_file(tmp_path, kitti()[:-1]), format="kitti")


@pytest.mark.parametrize("columns", [3, 5, 6])
def test_rows_of_another_length_are_refused(tmp_path: Path, columns: int) -> None:
    rng = np.random.default_rng(0)
    extra = rng.integers(0, 255, (4000, columns - 3))
    rows = np.hstack([rng.normal(0, 20, (4000, 3)), extra]).astype("<f4")
    with pytest.raises(MalformedFileError, match="set 'columns'"):
        read_points(write_file(tmp_path, rows.tobytes()), format="kitti")
