"""Names of well-known formats that are not read, for error messages."""

from __future__ import annotations

import re
from collections.abc import Callable

from service.formats.numerals import is_number, significant_line

_EXPORT = "export it as PLY, PCD, LAS or E57"
_MAGICS: tuple[tuple[tuple[bytes, ...], str, str], ...] = (
    ((b"ISO-10303-21",), "STEP", "export its surface as STL"),
    ((b"version https://git-lfs",), "Git LFS pointer", "fetch the file with: git lfs pull"),
    ((b"SQLite format 3\0",), "SQLite", _EXPORT),
    ((b"#ROSBAG V",), "ROS bag", "export its scans as PCD"),
    ((b"\x89MCAP0\r\n",), "MCAP", "export its scans as PCD"),
    ((b"\xd4\xc3\xb2\xa1", b"\xa1\xb2\xc3\xd4", b"\n\r\r\n"), "packet capture", _EXPORT),
    ((b"Kaydara FBX Binary",), "FBX", "export it as OBJ or glTF"),
    ((b"BLENDER",), "Blender", "export it as PLY, OBJ or glTF"),
    ((b"II*\0", b"MM\0*"), "TIFF", "convert the raster to lines of x y z"),
    ((b"\x89PNG", b"\xff\xd8\xff", b"GIF8"), "image", "send a point cloud"),
    ((b"%PDF",), "PDF", "send a point cloud"),
    ((b"<!DOCTYPE html", b"<!doctype html", b"<html", b"<HTML"), "HTML", "send a point cloud"),
    ((b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1",), "Microsoft Office", "save the sheet as CSV"),
    ((b"#VRML", b"#X3D"), "VRML", "export it as PLY, OBJ or glTF"),
    ((b"AC10",), "DWG", "export its points as LAS or its surfaces as STL"),
    ((b"#usda", b"PXR-USDC"), "USD", "export it as glTF, OBJ or PLY"),
)
"""Beginnings of files, the name of the format, and what to do."""
_BY_SUFFIX = {
    (".fls", ".fws", ".lsproj"): ("FARO", "export E57 in FARO Scene"),
    (".rcp", ".rcs"): ("Autodesk ReCap", "export E57 in ReCap"),
    (".rxp", ".rdb", ".rdbx"): ("RIEGL", "export LAS or E57 in RiSCAN"),
    (".zfs", ".zfprj"): ("Zoller+Froehlich", "export E57 in LaserControl"),
    (".lgs", ".lgsx", ".imp"): ("Leica Cyclone", "export E57 or PTX in Cyclone"),
    (".dwg", ".dxf"): ("AutoCAD", "export its points as LAS or its surfaces as STL"),
    (".usdz", ".usd"): ("USD", "export it as glTF, OBJ or PLY"),
    (".step", ".stp", ".iges", ".igs"): ("CAD", "export its surface as STL"),
    (".bag", ".db3", ".mcap"): ("ROS", "export its scans as PCD"),
    (".pcap", ".pcapng"): ("a packet capture", _EXPORT),
    (".lvx", ".ksplat"): ("an older Livox or splat file", _EXPORT),
    (".cl3", ".clr", ".tzf"): ("Topcon or Trimble", "export it as E57"),
}
"""Formats without a public description, by the ends of their names: the maker, and what to do."""
_ODD_OFF = re.compile(rb"(?:ST)?C?N?(?:4|4?n)OFF")
_ATOM = re.compile(rb"[A-Z][a-z]?")


def foreign_format(head: bytes) -> str | None:
    """Describe a file of a well-known format that is not read, and what to do; else None."""
    for magics, name, advice in _MAGICS:
        if head.startswith(magics):
            return f"{name} ({head[:8]!r}), which is not read: {advice}"
    return next((text for check, text in _CHECKS if check(head)), None)


def foreign_by_name(name: str) -> str | None:
    """Describe a file of a well-known format that is not read, by its name; else None."""
    for suffixes, (maker, advice) in _BY_SUFFIX.items():
        if name.lower().endswith(suffixes):
            return f"{name[-40:]!r} looks like a file of {maker}, which is not read: {advice}"
    return None


def _is_riegl(head: bytes) -> bool:
    return b"RieglLMS" in head[:64] or b"RIEGL" in head[:64]


def _is_esri_grid(head: bytes) -> bool:
    lines = head[:400].lower().split(b"\n")
    return lines[0].split()[:1] == [b"ncols"] and any(b"nrows" in line for line in lines[1:2])


def _is_collada(head: bytes) -> bool:
    start = head[:1000]
    return start.lstrip().startswith(b"<") and b"<COLLADA" in start


def _is_iges(head: bytes) -> bool:
    return (len(head) > 80 and head[72:80] == b"S      1") or head[72:80] == b"S0000001"


def _is_molecule(head: bytes) -> bool:
    """Whether the third line is an element's symbol and a position, as in chemical XYZ files."""
    lines = head[:2000].split(b"\n")[:3]
    if len(lines) < 3 or not lines[0].strip().isdigit():
        return False
    symbol, *numbers = lines[2].split()[:4] or [b""]
    return bool(
        _ATOM.fullmatch(symbol)
        and len(numbers) == 3
        and all(is_number(word.decode("latin1")) for word in numbers)
    )


def _is_odd_off(head: bytes) -> bool:
    """Whether it is OFF in binary, or of other than three dimensions."""
    words = significant_line(head)[:200].split()[:2]
    return bool(words) and (
        _ODD_OFF.fullmatch(words[0]) is not None
        or (words[0].endswith(b"OFF") and words[1:] == [b"BINARY"])
    )


def _is_matlab_text(head: bytes) -> bool:
    line = significant_line(head)[:200]
    return re.match(rb"[A-Za-z]\w{0,60}[ \t]?=[ \t]?\[", line) is not None


_CHECKS: tuple[tuple[Callable[[bytes], bool], str], ...] = (
    (_is_riegl, "a RIEGL scan, which is not read: export it as LAS or E57"),
    (_is_esri_grid, "an ESRI ASCII grid, which is not read: convert it to lines of x y z"),
    (_is_collada, "COLLADA, which is not read: export it as PLY or OBJ"),
    (_is_iges, "IGES, which is not read: export its surface as STL"),
    (_is_molecule, "a molecule in the chemical XYZ format, which is not read"),
    (
        _is_odd_off,
        "OFF in binary or of n dimensions, which is not read: save it as ASCII OFF or PLY",
    ),
    (_is_matlab_text, "MATLAB text, which is not read: export the matrix as CSV"),
)
