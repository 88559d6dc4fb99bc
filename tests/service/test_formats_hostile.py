"""Damaged and malicious files: an error that says so, or the points that the file holds."""

from __future__ import annotations

import io
import pickle
import struct
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest

from service.formats import (
    CloudFileError,
    DecodedCloud,
    FileLimitError,
    Limits,
    TruncatedFileError,
    UnsupportedFileError,
    read_points,
)
from tests.service.cloud_files import POINTS, npy, npz, pcd, ply, seeds, text_rows
from tests.service.scanner_files import e57, las, scanner_seeds

ALL = seeds() | scanner_seeds()
MOST_MEMORY = 8 << 20  # bytes; the files here have a few kilobytes


def attempt(tmp_path: Path, content: bytes) -> DecodedCloud | CloudFileError:
    """Decode, with little memory; any exception other than CloudFileError fails the test."""
    path = tmp_path / "cloud"
    path.write_bytes(content)
    tracemalloc.start()
    try:
        return read_points(path)
    except CloudFileError as error:
        return error
    finally:
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < MOST_MEMORY + 16 * len(content)


@pytest.mark.parametrize("kind", seeds())
def test_a_cut_file_is_an_error_or_gives_its_points(tmp_path: Path, kind: str) -> None:
    """A text without a count cannot know: it gives the whole rows before the cut and says so."""
    content = seeds()[kind]
    step = max(1, len(content) // 150)
    for size in [*range(0, len(content), step), *range(len(content) - 20, len(content))]:
        found = attempt(tmp_path, content[:size])
        if isinstance(found, CloudFileError):
            assert str(found)
            continue
        points = found.points.astype(np.float32)
        if kind in ("xyz", "csv"):
            whole = len(points) - any("may have been cut" in w for w in found.warnings)
            np.testing.assert_array_equal(points[:whole], POINTS[:whole])
        elif any("may have been cut" in warning for warning in found.warnings):
            np.testing.assert_array_equal(points[:-1], POINTS[:-1])
        else:
            np.testing.assert_array_equal(points, POINTS)


@pytest.mark.parametrize("kind", ALL)
def test_flipped_bits_are_an_error_or_points(tmp_path: Path, kind: str) -> None:
    content = ALL[kind]
    rng = np.random.default_rng(len(content))
    for _ in range(150):
        damaged = bytearray(content)
        # half of the flips hit the header, where they hurt
        reach = len(content) if rng.random() < 0.5 else min(len(content), 300)
        for place in rng.integers(0, reach, rng.integers(1, 4)):
            damaged[place] ^= 1 << rng.integers(8)
        found = attempt(tmp_path, bytes(damaged))
        if isinstance(found, DecodedCloud):
            assert found.points.shape[1:] == (3,)
            assert len(found.points) <= len(content)


@pytest.mark.parametrize("kind", scanner_seeds())
def test_a_cut_scanner_file_is_an_error_or_gives_its_points(tmp_path: Path, kind: str) -> None:
    """What stands behind the points (faces, the end of a solid) may be cut; text cannot know."""
    content = ALL[kind]
    whole = attempt(tmp_path, content)
    assert isinstance(whole, DecodedCloud)
    for size in np.unique(np.linspace(0, len(content) - 1, 120).astype(int)):
        found = attempt(tmp_path, content[:size])
        if isinstance(found, DecodedCloud):
            count = len(found.points)
            assert count == len(whole.points) or kind == "obj", size
            np.testing.assert_array_equal(found.points[:-1], whole.points[: count - 1])


def zip_of(name: str, content: bytes, method: int = zipfile.ZIP_DEFLATED) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", method) as archive:
        archive.writestr(name, content)
    return file.getvalue()


def npy_header(text: str, version: bytes = b"\x01\x00") -> bytes:
    return b"\x93NUMPY" + version + struct.pack("<H", len(text)) + text.encode()


class _Pickle:
    def __reduce__(self) -> tuple[object, ...]:
        return (open, ("/tmp/mpe-unpickled", "w"))


COMPRESSED = pcd("binary_compressed")
SIZES_AT = COMPRESSED.index(b"binary_compressed\n") + len(b"binary_compressed\n")
MANY = str(10**17).encode()
LAS, LAZ = las(), las(compressed=True)


def patched(content: bytes, at: int, form: str, value: int | float) -> bytes:
    """The content with a number replaced."""
    packed = struct.pack(form, value)
    return content[:at] + packed + content[at + len(packed) :]


LIES = {
    "las points 4e9": patched(LAS, 107, "<I", 4_000_000_000),
    "las one more": patched(LAS, 107, "<I", 41),
    "las records 4e9": patched(LAS, 100, "<I", 4_000_000_000),
    "las header 65535": patched(LAS, 94, "<H", 65535),
    "las points behind the end": patched(LAS, 96, "<I", 2**31),
    "las rows of 1 byte": patched(LAS, 105, "<H", 1),
    "las format 60": patched(LAS, 104, "<B", 60),
    "las scale NaN": patched(LAS, 131, "<d", float("nan")),
    "las 1.4 extended records 4e9": patched(las(version="1.4"), 243, "<I", 4_000_000_000),
    "las 1.4 points 1e18": patched(las(version="1.4"), 247, "<Q", 10**18),
    "laz one more": patched(LAZ, 107, "<I", 41),
    "laz points 4e9": patched(LAZ, 107, "<I", 4_000_000_000),
    "laz points 49 million": patched(LAZ, 107, "<I", 49_000_000),
    "e57 length": patched(e57(), 16, "<Q", 10**15),
    "e57 XML at 1e18": patched(e57(), 24, "<Q", 10**18),
    "e57 XML of 1e18": patched(e57(), 32, "<Q", 10**18),
    "e57 pages of 0": patched(e57(), 40, "<Q", 0),
    "ply counts 1e17": ply().replace(b"vertex 40", b"vertex " + MANY),
    "ply counts 4e9": ply().replace(b"vertex 40", b"vertex 4000000000"),
    "ply counts one more": ply().replace(b"vertex 40", b"vertex 41"),
    "ascii ply counts one more": ply("ascii").replace(b"vertex 40", b"vertex 41"),
    "ply counts 49 million": ply("ascii").replace(b"vertex 40", b"vertex 49000000"),
    "ply counts -1": ply().replace(b"vertex 40", b"vertex -1"),
    "ply counts 1e5000": ply().replace(b"vertex 40", b"vertex " + b"9" * 5000),
    "ply faces 4e9": ply(lists="before").replace(b"face 4", b"face 4000000000"),
    "ply faces after 4e9": ply(lists="after").replace(b"face 4", b"face 4000000000"),
    "ply list of 4e9": ply(lists="before").replace(b"uchar int", b"uint int"),
    "ply list of negative length": ply(lists="before")
    .replace(b"list uchar int", b"list char int")
    .replace(b"end_header\n\x03", b"end_header\n\x83"),
    "ply of 1e9 empty elements": b"ply\nformat ascii 1.0\nelement a 1000000000\nelement vertex 1\n"
    b"property float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n",
    "ply without properties": b"ply\nformat binary_little_endian 1.0\nelement a 1000000000000\n"
    b"element vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
    + bytes(12),
    "pcd points 4e9": pcd()
    .replace(b"POINTS 40", b"POINTS 4000000000")
    .replace(b"WIDTH 20", b"WIDTH 2000000000"),
    "pcd points 1e17": pcd()
    .replace(b"POINTS 40", b"POINTS " + MANY)
    .replace(b"WIDTH 20\nHEIGHT 2", b"WIDTH " + MANY + b"\nHEIGHT 1"),
    "pcd one more": pcd()
    .replace(b"POINTS 40", b"POINTS 41")
    .replace(b"H 20\nHEIGHT 2", b"H 41\nHEIGHT 1"),
    "pcd count 65537": pcd().replace(b"COUNT 1", b"COUNT 65537"),
    "pcd count 0": pcd().replace(b"COUNT 1", b"COUNT 0"),
    "pcd compressed size 4e9": COMPRESSED[:SIZES_AT] + b"\xff" * 4 + COMPRESSED[SIZES_AT + 4 :],
    "pcd expanded size 4e9": COMPRESSED[: SIZES_AT + 4] + b"\xff" * 4 + COMPRESSED[SIZES_AT + 8 :],
    "pcd expanded size one less": COMPRESSED[: SIZES_AT + 4]
    + struct.pack("<I", 1199)
    + COMPRESSED[SIZES_AT + 8 :],
    "pcd back reference before the start": COMPRESSED[:SIZES_AT]
    + struct.pack("<II", 60, 1200)
    + b"\xff" * 60,
    "npy shape 1e12": npy_header(
        "{'descr': '<f4', 'fortran_order': False, 'shape': (1000000000000, 3)}"
    ),
    "npy shape negative": npy_header("{'descr': '<f4', 'fortran_order': False, 'shape': (-1, 3)}")
    + bytes(24),
    "npy shape overflows": npy_header(
        "{'descr': '<f4', 'fortran_order': False, 'shape': (4294967296, 4294967296, 3)}"
    ),
    "npy one row more": npy(POINTS).replace(b"(40, 3)", b"(41, 3)"),
    "npy nested": npy_header("(" * 5000),
    "npy dtype bomb": npy_header(
        "{'descr': '<V2000000000', 'fortran_order': False, 'shape': (1,)}"
    ),
    "npy of nothing": npy_header(
        "{'descr': '|V0', 'fortran_order': False, 'shape': (1000000000000, 3)}"
    ),
    "npy version 9": b"\x93NUMPY\x09\x00" + bytes(200),
    "npz directory cut": npz(points=POINTS)[:-30],
    "npz without an array": zip_of("readme.txt", b"hello"),
    "npz of text": zip_of("points.npy", b"hello"),
    "npz with bytes behind the array": zip_of("points.npy", npy(POINTS) + bytes(9)),
    "npz shape 1e12": zip_of(
        "points.npy",
        npy_header("{'descr': '<f4', 'fortran_order': False, 'shape': (1000000000000, 3)}"),
    ),
    "text of zero bytes": text_rows(POINTS) + bytes(100) + text_rows(POINTS),
    "UTF-16": text_rows(POINTS).decode().encode("utf-16"),
    "hex and underscores": b"0x10 0x20 0x30\n1_0 2_0 3_0\n",
    "text count 1e17": MANY + b"\n" + text_rows(POINTS),
}


@pytest.mark.parametrize("case", LIES)
def test_lies_are_errors(tmp_path: Path, case: str) -> None:
    found = attempt(tmp_path, LIES[case])
    assert isinstance(found, CloudFileError), found
    assert str(found)


def test_pickles_are_never_loaded(tmp_path: Path) -> None:
    array = np.array([_Pickle()], dtype=object)
    for content in (npy(array), npz(points=array), pickle.dumps(_Pickle())):
        assert isinstance(attempt(tmp_path, content), CloudFileError)
    assert isinstance(attempt(tmp_path, npy(array)), UnsupportedFileError)
    assert not Path("/tmp/mpe-unpickled").exists()


def test_bombs_are_refused_before_they_expand(tmp_path: Path) -> None:
    zeros = npy(np.zeros((3_000_000, 3)))
    bomb = zip_of("points.npy", zeros)
    assert len(bomb) < len(zeros) / 500
    found = attempt(tmp_path, bomb)
    assert isinstance(found, FileLimitError)
    lying = bytearray(bomb)
    size = struct.pack("<I", len(zeros))
    for at in (bomb.find(size), bomb.rfind(size)):
        lying[at : at + 4] = struct.pack("<I", 1000)
    assert isinstance(attempt(tmp_path, bytes(lying)), CloudFileError)


@pytest.mark.parametrize(
    "content",
    [
        b"ply\n" + b"comment " + b"x" * 2_000_000 + b"\n" + ply()[4:],
        b"ply\n" + b"comment x\n" * 100_000 + ply()[4:],
        ply().replace(
            b"property float z\n",
            b"property float z\n" + b"".join(b"property float p%d\n" % i for i in range(300)),
        ),
        b"# comment\n" * 100_000 + pcd(),
        pcd().replace(b"FIELDS ", b"FIELDS " + b"a " * 1000),
        b"1 2 3" + b" 4" * 100_000 + b"\n",
        b"1 2 3\n" + b"4" * 1_000_000,
        b"# x\n" * 3000 + text_rows(POINTS),
    ],
    ids=[
        "long line",
        "many lines",
        "many properties",
        "pcd comments",
        "pcd fields",
        "wide row",
        "endless line",
        "long header",
    ],
)
def test_sizes_of_headers_and_lines_are_bounded(tmp_path: Path, content: bytes) -> None:
    assert isinstance(attempt(tmp_path, content), CloudFileError)


def test_the_limit_on_points_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "cloud"
    for content in seeds().values():
        path.write_bytes(content)
        with pytest.raises(FileLimitError):
            read_points(path, Limits(max_points=2))


def test_a_cut_names_the_byte(tmp_path: Path) -> None:
    found = attempt(tmp_path, ply(lists="inside")[:-1])
    assert isinstance(found, TruncatedFileError)
    assert "39 of 40 rows" in str(found)
