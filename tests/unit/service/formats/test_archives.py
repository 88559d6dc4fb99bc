"""gzip and zip files around one cloud."""

from __future__ import annotations

import gzip
import io
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from service.formats import CloudFileError, ReadLimits, UnsupportedFileError, read_points
from service.problems import is_disk_full
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


def zip_members(**members: bytes) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return file.getvalue()


CLUTTERED = {
    "Mac": {"a.ply": ply(), "__MACOSX/._a.ply": b"\0\5\x16\7", ".DS_Store": b"\0\0\0\1Bud1"},
    "Mac, in a folder": {"b/a.ply": ply(), "b/.DS_Store": b"\0", "__MACOSX/b/._a.ply": b"\0"},
    "Windows": {"a.ply": ply(), "Thumbs.db": b"\0", "desktop.ini": b"[a]"},
    "what tells about it": {"a.ply": ply(), "README.txt": b"hi", "LICENSE": b"free"},
    "OBJ with material and picture": {"a.obj": obj(), "a.mtl": b"newmtl a\n", "a.PNG": b"\x89PNG"},
}


@pytest.mark.parametrize("case", CLUTTERED)
def test_files_beside_the_cloud_are_ignored(tmp_path: Path, case: str) -> None:
    path = write_file(tmp_path, zip_members(**CLUTTERED[case]))
    np.testing.assert_array_equal(read_points(path).points.astype(np.float32), POINTS)


@pytest.mark.parametrize(
    ("member", "words"),
    [("xl/workbook.xml", "Excel"), ("archive/data.pkl", "PyTorch"), ("3D/3dmodel.model", "3MF")],
)
def test_documents_that_are_archives_are_named(tmp_path: Path, member: str, words: str) -> None:
    with pytest.raises(UnsupportedFileError, match=words):
        read_points(write_file(tmp_path, zip_members(**{member: b"", "other": b""})))


def test_text_that_is_rewritten_leaves_some_of_the_disk_free(tmp_path: Path) -> None:
    path = write_file(tmp_path, text_rows(POINTS).decode().encode("utf-16"))
    with pytest.raises(OSError, match="of the disk") as refused:
        read_points(path, ReadLimits(min_free_disk_bytes=2**60))
    assert is_disk_full(refused.value)
    assert list(tmp_path.iterdir()) == [path]


def test_files_of_an_unclear_zip_are_named(tmp_path: Path) -> None:
    path = write_file(tmp_path, zip_members(**{"a.xyz": ply(), "b.xyz": ply(), ".DS_Store": b""}))
    with pytest.raises(UnsupportedFileError, match=r"2 files \('a.xyz', 'b.xyz'\)"):
        read_points(path)


@pytest.mark.parametrize("wrap", [gzip.compress, zipped])
def test_an_expansion_leaves_some_of_the_disk_free(
    tmp_path: Path, wrap: Callable[[bytes], bytes]
) -> None:
    """That is the fault of the disk, not of the file: the chain of errors tells."""
    path = write_file(tmp_path, wrap(text_rows(POINTS)))
    with pytest.raises(CloudFileError, match="cannot be expanded") as refused:
        read_points(path, ReadLimits(min_free_disk_bytes=2**60))
    assert isinstance(refused.value.__context__, OSError)
    assert is_disk_full(refused.value)
    assert list(tmp_path.iterdir()) == [path]
