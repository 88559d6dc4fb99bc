"""What is written is read back."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from service.formats import read_points, write_ply
from tests.factories.cloud_files import POINTS


def test_written_ply_keeps_precision_and_points(tmp_path: Path) -> None:
    write_ply(tmp_path / "a.ply", POINTS)
    cloud = read_points(tmp_path / "a.ply")
    assert cloud.points.dtype == np.float32
    np.testing.assert_array_equal(cloud.points, POINTS)
    assert cloud.warnings == ()


def test_double_precision_survives(tmp_path: Path) -> None:
    points = POINTS.astype(np.float64) + np.array([500_000.000123, 4_000_000.000456, 0])
    write_ply(tmp_path / "utm.ply", points)
    np.testing.assert_array_equal(read_points(tmp_path / "utm.ply").points, points)
