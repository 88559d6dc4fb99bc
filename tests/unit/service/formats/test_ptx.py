"""PTX files with one scan or several."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from service.formats import MalformedFileError, read_points
from tests.factories.decoding import write_file
from tests.factories.scanner_files import DOUBLES, ptx


def test_scans_are_merged_or_picked(tmp_path: Path) -> None:
    path = write_file(tmp_path, ptx(scans=2))
    merged = read_points(path)
    np.testing.assert_allclose(merged.points, DOUBLES, atol=2e-5)
    assert "2 scans are merged" in merged.warnings[0]
    second = read_points(path, scan=1)
    np.testing.assert_allclose(second.points, DOUBLES[20:], atol=2e-5)
    assert second.warnings == ()
    for scan in (-1, 2):
        with pytest.raises(MalformedFileError, match="the file has 2"):
            read_points(path, scan=scan)


def test_missing_returns_of_ptx_are_nan(tmp_path: Path) -> None:
    lines = ptx().splitlines()
    lines[12] = b"0 0 0 0.5"
    points = read_points(write_file(tmp_path, b"\n".join(lines) + b"\n")).points
    assert np.isnan(points[2]).all()
    np.testing.assert_allclose(np.delete(points, 2, 0), np.delete(DOUBLES, 2, 0), atol=2e-5)
