"""E57 files with one scan or several."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from service.formats import CloudFileError, MalformedFileError, read_points
from service.formats.e57 import _check_xml
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


@pytest.mark.parametrize(
    ("xml", "accepted"),
    [
        (b'<?xml version="1.0" encoding="UTF-8"?><e57Root/>', True),
        (b"<?xml version='1.0' encoding = 'utf-8' ?><e57Root/>", True),
        (b'<?xml version="1.0"?><e57Root/>', True),
        (b"<e57Root/>", False),
        (b'<?xml version="1.0" encoding="EBCDIC-CP-US"?><e57Root/>', False),
        (b'<?xml version="1.0" encoding="UTF-16"?><e57Root/>', False),
        ('<?xml version="1.0" encoding="UTF-16"?><e57Root/>'.encode("utf-16"), False),
        ('<?xml version="1.0"?><!DOCTYPE a><e57Root/>'.encode("utf-16-le"), False),
        (b'<?xml version="1.0"?>\0<e57Root/>', False),
        (b'<?xml version="1.0"?><!DOCTYPE a><e57Root/>', False),
        (b'<?xml version="1.0"?><!ENTITY a "b"><e57Root/>', False),
    ],
)
def test_the_xml_is_utf_8_without_document_type(xml: bytes, accepted: bool) -> None:
    if accepted:
        _check_xml(xml)
    else:
        with pytest.raises(CloudFileError):
            _check_xml(xml)
