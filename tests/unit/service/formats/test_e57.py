"""E57 files with one scan or several."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from service.formats import MalformedFileError, read_points
from tests.factories.decoding import write_file
from tests.factories.scanner_files import DOUBLES, e57, whole_e57


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


@pytest.mark.parametrize("mode", ["other element", "none"])
def test_points_without_a_prototype_are_refused(tmp_path: Path, mode: str) -> None:
    """libE57 reads through a null pointer, which ends the process."""
    content = e57().replace(b"prototype", b"prototypf")
    if mode == "none":
        start, end = content.index(b"<prototypf"), content.index(b"</prototypf>") + 12
        content = content[:start] + b" " * (end - start) + content[end:]
    with pytest.raises(MalformedFileError, match="no prototype"):
        read_points(write_file(tmp_path, whole_e57(content)))
