"""E57 files with one scan or several."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from service.formats import MalformedFileError, read_points
from tests.factories.decoding import write_file
from tests.factories.scanner_files import DOUBLES, e57


def test_scans_are_merged_or_picked(tmp_path: Path) -> None:
    path = write_file(tmp_path, e57(scans=2))
    merged = read_points(path)
    np.testing.assert_allclose(merged.points, DOUBLES, atol=2e-5)
    assert "2 scans are merged" in merged.warnings[0]
    second = read_points(path, scan=1)
    np.testing.assert_allclose(second.points, DOUBLES[20:], atol=2e-5)
    assert second.warnings == ()
    for scan in (-1, 2):
        with pytest.raises(MalformedFileError, match="the file has 2"):
            read_points(path, scan=scan)
