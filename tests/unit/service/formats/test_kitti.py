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
