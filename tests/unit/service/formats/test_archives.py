"""gzip and zip files around one cloud."""

from __future__ import annotations

import gzip
import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

from service.formats import CloudFileError, UnsupportedFileError, read_points
from tests.factories.cloud_files import POINTS, npz, ply, text_rows
from tests.factories.decoding import write_file
from tests.factories.scanner_files import e57, las, obj, zipped


def test_wrapped_files(tmp_path: Path) -> None:
    for content in (gzip.compress(text_rows(POINTS)), zipped(las(compressed=True)), zipped(obj())):
        assert len(read_points(write_file(tmp_path, content)).points) == 40
    assert len(read_points(write_file(tmp_path, zipped(e57(scans=2))), scan=0).points) == 20
    assert list(tmp_path.iterdir()) == [tmp_path / "cloud"]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (zipped(zipped(ply())), "another archive"),
        (gzip.compress(gzip.compress(ply())), "another archive"),
        (zipped(b""), "empty"),
    ],
)
def test_refused(tmp_path: Path, content: bytes, words: str) -> None:
    path = write_file(tmp_path, content)
    with pytest.raises(CloudFileError, match=words):
        read_points(path)


def test_npz_within_gzip(tmp_path: Path) -> None:
    path = write_file(tmp_path, gzip.compress(npz(points=POINTS)))
    np.testing.assert_array_equal(read_points(path).points, POINTS)


def test_two_files_in_a_zip_are_not_clear(tmp_path: Path) -> None:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("a.ply", ply())
        archive.writestr("b.ply", ply())
    with pytest.raises(UnsupportedFileError, match="2 files"):
        read_points(write_file(tmp_path, file.getvalue()))
