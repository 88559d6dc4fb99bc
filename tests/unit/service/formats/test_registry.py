"""Every format of the registry is recognised, and held to when declared."""

from __future__ import annotations

from pathlib import Path

import pytest

from service.formats import FORMATS, CloudFileError, UnknownFormatError, read_points, sniff
from service.formats.column_names import find_normals
from tests.factories.array_files import array_seeds
from tests.factories.cloud_files import ply, seeds
from tests.factories.decoding import write_file
from tests.factories.scanner_files import scanner_seeds


def test_every_format_has_a_case() -> None:
    met = {
        sniff(content[:4096]) for content in (seeds() | scanner_seeds() | array_seeds()).values()
    }
    assert met | {"kitti"} == {format.name for format in FORMATS}


def test_what_is_said_to_be_kept_is_kept(tmp_path: Path) -> None:
    """Faces and normals are named where some file of the format has them, and nowhere else."""
    found: dict[str, set[str]] = {format.name: set() for format in FORMATS}
    for content in (seeds() | scanner_seeds() | array_seeds()).values():
        cloud = read_points(write_file(tmp_path, content), attributes=True)
        has_normals = cloud.normals is not None or find_normals(list(cloud.attributes)) is not None
        kinds = {"faces"} if cloud.faces is not None else set()
        found[sniff(content[:4096]) or ""] |= kinds | ({"normals"} if has_normals else set())
    for format in FORMATS:
        if format.name in ("draco", "gzip", "npy", "xyz"):  # no such seed
            continue
        said = {word for word in ("faces", "normals") if word in format.kept}
        is_inner = "in the file inside" in format.kept
        assert found[format.name] == said or (is_inner and said <= found[format.name]), format.name


def test_a_declared_format_is_held_to(tmp_path: Path) -> None:
    for format in FORMATS:
        if format.name not in ("ply", "kitti"):
            with pytest.raises(CloudFileError):
                read_points(write_file(tmp_path, ply()), format=format.name)
    with pytest.raises(UnknownFormatError, match="no format is called 'docx'"):
        read_points(write_file(tmp_path, ply()), format="docx")
