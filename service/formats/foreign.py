"""Recognition of well-known formats that are not read, for error messages."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable

from service.formats.column_names import find_xyz
from service.formats.foreign_beginnings import foreign_beginning
from service.formats.numerals import is_number, significant_line

_ODD_OFF = re.compile(rb"(?:ST)?C?N?(?:4|4?n)OFF")
_ATOM = re.compile(rb"[A-Z][a-z]?")
_MAX_ATOMIC_NUMBER = 118
_NETPBM = re.compile(
    rb"P[1-7][ \t]{0,9}\r?\n(?:#[^\n]{0,200}\n){0,9}(?:[ \t]{0,9}\d{1,6}\s{1,9}\d|WIDTH)"
    rb"|P[4-6]\s{1,9}\d{1,6}\s{1,9}\d{1,6}\s{1,9}\d{1,6}\s[^\n]{0,400}?[\0-\x08]"
    rb"|P[fF]\s{1,9}\d{1,6}\s{1,9}\d{1,6}\s{1,9}-?\d"
)
"""Portable maps of bits, of grey, of pixels and of floats: the letter alone is a point's label."""
_G_CODE = re.compile(
    rb"^(?:N\d{1,9} ?)?G0?[0-3] ?(?:[EF]\d{1,9}(?:\.\d{0,9})? ?)?[XYZ]-?\.?\d", re.MULTILINE
)
_UNIVERSAL = re.compile(rb" {0,9}-1 *\r?\n {1,9}\d{1,4} *\r?\n")
_GSI = re.compile(rb"\*?11\d{4}[+-]\w{8,16} [^\n]{0,200}\b(?:[283][1-7])[.\d]{4}[+-]\d")
_HEAD_BYTES = 4000
_CHECKSUM = slice(148, 156)
"""Bytes of a tar archive's header that hold the sum of the others, in octal."""
_TAR_HEADER_BYTES = 512
_3DS_CHUNKS = (b"\x02\0", b"==")


def foreign_format(head: bytes) -> str | None:
    """Describe a file of a well-known format that is not read, and what to do; else None."""
    return foreign_beginning(head) or next((text for check, text in _CHECKS if check(head)), None)


_KSPLAT_BYTES = 4096
"""Header of .ksplat."""


def _is_riegl(head: bytes) -> bool:
    return b"RieglLMS" in head[:64] or b"RIEGL" in head[:64]


def _is_ksplat(head: bytes) -> bool:
    """Whether version 0.1, and numbers of sections and splats that can be, as in .ksplat."""
    if head[:4] != b"\0\1\0\0" or len(head) < _KSPLAT_BYTES:
        return False
    max_sections, sections, max_splats, splats, level = struct.unpack_from("<4IH", head, 4)
    is_counted = 0 < sections <= max_sections < 10_000 and 0 < splats <= max_splats
    return bool(is_counted and level < 3)


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
    """Whether it is a tar archive, of old ones too, which have no other mark than their sum."""
    header, digits = head[:_TAR_HEADER_BYTES], head[_CHECKSUM].strip(b" \0")
    if header[257:262] == b"ustar":
        return True
    if len(header) < _TAR_HEADER_BYTES or not re.fullmatch(rb"[0-7]{3,7}", digits):
        return False
    return sum(header) - sum(header[_CHECKSUM]) + 8 * ord(" ") == int(digits, 8)


def _is_picture(head: bytes) -> bool:
    """Whether it is a bitmap of Windows, or a picture or video in boxes of MPEG-4."""
    is_bitmap = head.startswith(b"BM") and head[6:10] == bytes(4)
    return is_bitmap or head[4:8] == b"ftyp" or _NETPBM.match(head) is not None


def _is_volume(head: bytes) -> bool:
    return head[128:132] == b"DICM" or head[344:348] in (b"n+1\0", b"ni1\0")


def _is_3ds(head: bytes) -> bool:
    return head.startswith(b"MM") and head[6:8] in _3DS_CHUNKS and b"\0" in head[:16]


def _is_g_code(head: bytes) -> bool:
    return _G_CODE.search(head[:_HEAD_BYTES]) is not None


def _is_universal(head: bytes) -> bool:
    return _UNIVERSAL.match(head) is not None


def _is_gsi(head: bytes) -> bool:
    return _GSI.match(head) is not None


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
    (_is_ksplat, "splats of GaussianSplats3D (.ksplat), which are not read: export them as PLY"),
    (_is_esri_grid, "an ESRI ASCII grid, which is not read: convert it to lines of x y z"),
    (_is_arff, "ARFF of Weka, which is not read: save the table as CSV with a line of names"),
    (_is_grass_grid, "a GRASS ASCII grid, which is not read: convert it to lines of x y z"),
    (_is_tar, "a tar archive, which is not read: send one file, as it is, in gzip or in zip"),
    (
        _is_picture,
        "a picture, which is not read: turn each pixel's depth into a point x y z by the camera's "
        "intrinsics",
    ),
    (_is_volume, "a volume of medical images, which is not read: export its surface as STL"),
    (_is_3ds, "3DS, which is not read: export it as OBJ or PLY"),
    (_is_g_code, "G-code, which is not read: export the part as STL"),
    (_is_universal, "a universal file of FEM, which is not read: export its surface as STL"),
    (_is_gsi, "GSI of Leica, which is not read: export lines of number, easting, northing, height"),
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
