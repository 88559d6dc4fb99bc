"""Which format a file is of, and its reader."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from service.formats import numpy_file, pcd, ply, text
from service.formats.cloud import DecodedCloud, Limits
from service.formats.errors import TruncatedFileError, UnknownFormatError

SNIFFED_BYTES = 4096


@dataclass(frozen=True, slots=True)
class Format:
    name: str
    title: str
    extensions: tuple[str, ...]
    sniff: Callable[[bytes], bool]
    read: Callable[[Path, Limits], DecodedCloud]


def _starts(*magics: bytes) -> Callable[[bytes], bool]:
    return lambda head: head.startswith(magics)


FORMATS = (
    Format(
        "ply",
        "Stanford PLY: ASCII, binary of both byte orders; the vertices",
        (".ply",),
        _starts(b"ply\n", b"ply\r\n", b"ply "),
        ply.read,
    ),
    Format(
        "pcd",
        "Point Cloud Library: ASCII, binary, binary_compressed",
        (".pcd",),
        pcd.sniff,
        pcd.read,
    ),
    Format(
        "npy",
        "NumPy array (N, 3 or more), (H, W, 3), or with fields x, y, z",
        (".npy",),
        _starts(b"\x93NUMPY"),
        numpy_file.read_npy,
    ),
    Format(
        "npz",
        "NumPy archive: the array called points, xyz, ..., or the only one",
        (".npz",),
        _starts(b"PK\x03\x04"),
        numpy_file.read_npz,
    ),
    Format(
        "xyz",
        "text, one point a line: blanks, tabs, commas, semicolons; with header or without",
        (".xyz", ".txt", ".csv"),
        text.sniff,
        text.read,
    ),
)


def sniff(head: bytes) -> str | None:
    """Name the format of a file from its first bytes (4096 do), None if it is none of ours."""
    found = _find(head[:SNIFFED_BYTES])
    return found.name if found else None


def read_points(path: str | Path, limits: Limits | None = None) -> DecodedCloud:
    """Decode a cloud file; the content decides the format.

    Raises
    ------
    CloudFileError
        The file cannot be read as a cloud; the message names the byte or line.
    """
    path = Path(path)
    with path.open("rb") as file:
        head = file.read(SNIFFED_BYTES)
    if not head:
        raise TruncatedFileError("the file is empty")
    found = _find(head)
    if found is None:
        names = ", ".join(format.name for format in FORMATS)
        raise UnknownFormatError(f"begins with {head[:16]!r}: none of the formats {names}")
    return found.read(path, limits or Limits())


def _find(head: bytes) -> Format | None:
    return next((format for format in FORMATS if format.sniff(head)), None)
