"""Names of well-known formats that are not read, for error messages."""

from __future__ import annotations

import re
from collections.abc import Callable

from service.formats.column_names import find_xyz
from service.formats.numerals import is_number, significant_line

_EXPORT = "export it as PLY, PCD, LAS or E57"
_UNPACK = "send the file uncompressed, in gzip or zip"
_SAVE_NPY = "save the points as .npy, since pickles are never loaded"
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
    ((b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1",), "Microsoft Office", "save the sheet as CSV"),
    ((b"#VRML", b"#X3D"), "VRML", "export it as PLY, OBJ or glTF"),
    ((b"AC10",), "DWG", "export its points as LAS or its surfaces as STL"),
    ((b"#usda", b"PXR-USDC"), "USD", "export it as glTF, OBJ or PLY"),
    (
        (b"# Image list with two lines", b"# Camera list with one line"),
        "COLMAP's list of images or cameras",
        "send its points3D.bin or points3D.txt",
    ),
    ((b"# Bundle file",), "Bundler", "export its points as PLY"),
    ((b"NVM_V3",), "VisualSFM", "export its points as PLY"),
    ((b"DSAA", b"DSBB", b"DSRB"), "Surfer grid", "convert it to lines of x y z"),
    ((b"GOCAD ",), "GOCAD", "export its points as lines of x y z"),
    ((b"$MeshFormat",), "Gmsh", "export it as PLY, STL or VTK"),
    ((b"*Heading", b"*HEADING", b"*Node", b"*NODE"), "Abaqus", "export its surface as STL"),
    ((b"VERTEX_SE", b"EDGE_SE"), "g2o, a graph of poses", "send a cloud of points"),
    ((b"MeshVersionFormatted",), "Medit", "export it as PLY, STL or VTK"),
    ((b"BEGIN BULK", b"GRID,", b"GRID  ", b"SOL "), "Nastran", "export its surface as STL"),
    ((b"ATOM  ", b"HEADER    ", b"HETATM"), "PDB, a molecule", "send a point cloud"),
    ((b"RIFF", b"OggS", b"ID3"), "sound or video", "send a point cloud"),
    ((b"7z\xbc\xaf", b"Rar!", b"\x28\xb5\x2f\xfd", b"\xfd7zXZ", b"BZh"), "archive", _UNPACK),
    ((b"PK\x05\x06",), "empty zip archive", "put one cloud file into it"),
    ((b"3D Geometry File Format",), "Rhino", "export it as PLY, OBJ or E57"),
    ((b"CDF\x01", b"CDF\x02", b"CDF\x05"), "NetCDF", "save the points as .npy or HDF5"),
    ((b"pnts", b"b3dm", b"i3dm", b"cmpt"), "3D Tiles", _EXPORT),
    ((b"PAR1", b"ARROW1"), "Parquet or Arrow", "save the table as CSV or .npy"),
    ((b"\x80\x02", b"\x80\x03", b"\x80\x04", b"\x80\x05"), "Python pickle", _SAVE_NPY),
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
_MAX_ATOMIC_NUMBER = 118
_GUESSES: tuple[tuple[re.Pattern[bytes], str], ...] = (
    (
        re.compile(rb"[\[({]\s*[+-]?[\d.]"),
        "rows in brackets: write one point a line, x y z, without them, or save the array as .npy",
    ),
    (
        re.compile(rb"\{|\[\s*[\[{]"),
        "JSON, which is not read: write one point a line, x y z, or save the array as .npy",
    ),
    (
        re.compile(rb"<(?:!doctype html|html)", re.IGNORECASE),
        "HTML, a page of the web: send a point cloud",
    ),
    (re.compile(rb"<"), f"XML of another kind, which is not read: {_EXPORT}"),
    (
        re.compile(rb"(?:[^\n]{0,200}\n){0,3}[^\n]{0,200}\d[dD][+-]\d"),
        "numbers of Fortran, as 1.5D+02: write E in place of D",
    ),
    (
        re.compile(rb"(?:[^\n]{0,200}\n){0,3}[^\n]{0,200}\d\.\d{3}\.\d{3}"),
        "numbers with a sign between thousands, as 1.234.567: write 1234567",
    ),
    (
        re.compile(rb"(?:[^\n]{0,200}\n){0,3}[^\n]{0,200}(?:\d'\d{3}\b|\"\d{1,3}(?:,\d{3})+\.\d)"),
        "numbers with a sign between thousands, as 1'234'567 or 1,234,567.8: write 1234567.8",
    ),
    (
        re.compile(rb"(?:[^\n]{0,200}\n)?[^\n]{0,200}\b(?:MULTI)?POINT ?Z? ?\(", re.IGNORECASE),
        "geometry as WKT: export the coordinates as columns x, y and z",
    ),
    (
        re.compile(rb"[^\n]{0,200}\d\.\d{1,9}[+-]\d{1,9}\."),
        "numbers that touch, as -1.5-2.5: separate them by blanks or commas",
    ),
    (
        re.compile(rb"\s*[-+\d.eE]{1,30}[ \t,;]{1,9}[-+\d.eE]{1,30}[ \t]*\r?\n"),
        "rows of two numbers: expected three, x, y and z",
    ),
)
"""Beginnings of text that no reader takes, in the order in which they are tried."""


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


def guess_foreign(head: bytes) -> str | None:
    """Describe what no reader takes, by its first characters; else None."""
    start = head.lstrip()
    for pattern, text in _GUESSES:
        if pattern.match(start):
            return text
    return None


def _is_riegl(head: bytes) -> bool:
    return b"RieglLMS" in head[:64] or b"RIEGL" in head[:64]


def _is_esri_grid(head: bytes) -> bool:
    lines = head[:400].lower().split(b"\n")
    return lines[0].split()[:1] == [b"ncols"] and any(b"nrows" in line for line in lines[1:2])


def _is_arff(head: bytes) -> bool:
    lines = head[:2000].lower().split(b"\n")
    return any(line.startswith(b"@relation") for line in lines[:20])


def _is_grass_grid(head: bytes) -> bool:
    lines = head[:400].lower().split(b"\n")
    return lines[0].startswith(b"north:") and any(line.startswith(b"rows:") for line in lines)


def _is_tar(head: bytes) -> bool:
    return head[257:262] == b"ustar"


def _is_collada(head: bytes) -> bool:
    start = head[:1000]
    return start.lstrip().startswith(b"<") and b"<COLLADA" in start


def _is_iges(head: bytes) -> bool:
    return (len(head) > 80 and head[72:80] == b"S      1") or head[72:80] == b"S0000001"


def _is_molecule(head: bytes) -> bool:
    """Whether a count, a comment, and lines of an element and a position, as in chemical XYZ."""
    lines = head[:2000].split(b"\n")[:7]
    if len(lines) < 3 or not lines[0].strip().isdigit():
        return False
    atoms = [line.split() for line in lines[2 : max(3, len(lines) - 1)] if line.strip()]
    if not atoms or not all(_is_atom(words) for words in atoms):
        return False
    has_symbols = _ATOM.fullmatch(atoms[0][0]) is not None
    return has_symbols or _is_remark(lines[1].decode("latin1"))


def _is_remark(line: str) -> bool:
    """Whether a line is text, and neither a marked comment nor names of coordinates."""
    words = line.replace(",", " ").replace(";", " ").split()
    return (
        bool(words)
        and not line.startswith(("#", "//", "%"))
        and not is_number(words[0])
        and find_xyz(words) is None
    )


def _is_atom(words: list[bytes]) -> bool:
    """Whether a symbol, or an atomic number, stands before three numbers."""
    if len(words) < 4 or not all(is_number(word.decode("latin1")) for word in words[1:4]):
        return False
    is_numbered = words[0].isdigit() and 0 < int(words[0][:4]) <= _MAX_ATOMIC_NUMBER
    has_points = all(b"." in word for word in words[1:4])
    return _ATOM.fullmatch(words[0]) is not None or (is_numbered and has_points)


def _is_dxf(head: bytes) -> bool:
    lines = [line.strip() for line in head[:4000].split(b"\n")]
    pairs = list(zip(lines[::2], lines[1::2], strict=False))
    return next((pair for pair in pairs if pair[0] != b"999"), None) == (b"0", b"SECTION")


def _is_odd_off(head: bytes) -> bool:
    """Whether it is OFF in binary, or of other than three dimensions."""
    words = significant_line(head)[:200].split()[:2]
    return bool(words) and (
        _ODD_OFF.fullmatch(words[0]) is not None
        or (words[0].endswith(b"OFF") and words[1:] == [b"BINARY"])
    )


def _is_tecplot(head: bytes) -> bool:
    lines = [line.strip().upper() for line in head[:2000].split(b"\n")]
    return any(re.match(rb"VARIABLES\s*=", line) for line in lines[:20])


def _is_tetgen(head: bytes) -> bool:
    """Whether counts of points, dimensions and attributes, and numbered rows, as in .node."""
    lines = [line.split() for line in head[:2000].split(b"\n") if line.strip()[:1] not in b"#"][:4]
    if len(lines) < 4 or len(lines[0]) != 4 or not all(word.isdigit() for word in lines[0]):
        return False
    numbers = [line[0] for line in lines[1:3]]
    return lines[0][1] == b"3" and numbers in ([b"0", b"1"], [b"1", b"2"])


def _is_matlab_text(head: bytes) -> bool:
    line = significant_line(head)[:200]
    return re.match(rb"[A-Za-z]\w{0,60}[ \t]?=[ \t]?\[", line) is not None


_CHECKS: tuple[tuple[Callable[[bytes], bool], str], ...] = (
    (_is_riegl, "a RIEGL scan, which is not read: export it as LAS or E57"),
    (_is_esri_grid, "an ESRI ASCII grid, which is not read: convert it to lines of x y z"),
    (_is_arff, "ARFF of Weka, which is not read: save the table as CSV with a line of names"),
    (_is_grass_grid, "a GRASS ASCII grid, which is not read: convert it to lines of x y z"),
    (_is_tar, "a tar archive, which is not read: send one file, as it is, in gzip or in zip"),
    (_is_dxf, "DXF, which is not read: export its points as LAS or its surfaces as STL"),
    (_is_collada, "COLLADA, which is not read: export it as PLY or OBJ"),
    (_is_iges, "IGES, which is not read: export its surface as STL"),
    (_is_molecule, "a molecule in the chemical XYZ format, which is not read"),
    (
        _is_odd_off,
        "OFF in binary or of n dimensions, which is not read: save it as ASCII OFF or PLY",
    ),
    (_is_tecplot, "Tecplot, which is not read: save the points as CSV with a line of names"),
    (_is_tetgen, "nodes of TetGen, which are not read: remove the first line"),
    (_is_matlab_text, "MATLAB text, which is not read: export the matrix as CSV"),
)
