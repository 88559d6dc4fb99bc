"""Every format of the registry is recognised, and held to when declared."""

from __future__ import annotations

from pathlib import Path

import pytest

from service.formats import FORMATS, CloudFileError, UnknownFormatError, read_points, sniff
from tests.factories.array_files import array_seeds
from tests.factories.cloud_files import ply, seeds
from tests.factories.decoding import write_file
from tests.factories.scanner_files import scanner_seeds


def test_every_format_has_a_case() -> None:
    met = {
        sniff(content[:4096]) for content in (seeds() | scanner_seeds() | array_seeds()).values()
    }
    assert met | {"kitti"} == {format.name for format in FORMATS}


def test_a_declared_format_is_held_to(tmp_path: Path) -> None:
    for format in FORMATS:
        if format.name not in ("ply", "kitti"):
            with pytest.raises(CloudFileError):
                read_points(write_file(tmp_path, ply()), format=format.name)
    with pytest.raises(UnknownFormatError, match="no format is called 'docx'"):
        read_points(write_file(tmp_path, ply()), format="docx")
