"""The corpus of hostile files: the same on every run, more than two thousand."""

from __future__ import annotations

import gzip
import io
import re
import struct
import zipfile
from collections.abc import Iterator

import numpy as np

from tests.factories.cloud_files import POINTS, npy, npz, pcd, ply, seeds, text_rows
from tests.factories.scanner_files import (
    e57,
    las,
    ptx,
    scanner_seeds,
    stl_binary,
    whole_e57,
    zipped,
)

ALL = seeds() | scanner_seeds()
CUTS, FLIPS, COUNTS = 32, 22, 12


def damaged() -> Iterator[tuple[str, bytes]]:
    """Files of every kind with their names: cut, bits turned, wrong counts, twice, in a zip."""
    for kind, content in ALL.items():
        rng = np.random.default_rng(len(content))
        for size in np.unique(np.linspace(0, len(content) - 1, CUTS).astype(int)):
            yield f"{kind} cut at {size}", content[:size]
        for i in range(FLIPS):
            yield f"{kind} flipped {i}", flipped(content, rng)
        for i in range(COUNTS):
            yield f"{kind} miscounted {i}", _miscounted(content, rng)
        yield f"{kind} twice", content * 2
        yield f"{kind} zipped under a bad name", zipped(content, "../../../../tmp/é\u202e.ply")


def flipped(content: bytes, rng: np.random.Generator) -> bytes:
    """One to three bits turned; half of the time in the first bytes, where it hurts."""
    changed = bytearray(content)
    reach = len(content) if rng.random() < 0.5 else min(len(content), 300)
    for place in rng.integers(0, reach, rng.integers(1, 4)):
        changed[place] ^= 1 << rng.integers(8)
    return bytes(changed)


def _miscounted(content: bytes, rng: np.random.Generator) -> bytes:
    """A number in the header replaced: a decimal one of text, or four bytes of a binary one."""
    extremes = (0, 1, 41, 2**16, 2**31 - 1, 2**32 - 1)
    value = int(rng.choice(extremes))
    numbers = [m.span() for m in re.finditer(rb"\b\d+\b", content[:400]) if content[:1] > b"#"]
    if numbers and b"\0" not in content[:40]:
        start, end = numbers[rng.integers(len(numbers))]
        return content[:start] + str(value).encode() + content[end:]
    at = int(rng.integers(4, min(len(content), 300) - 4))
    return patched(content, at, "<I", value)


def zip_of(name: str, content: bytes, method: int = zipfile.ZIP_DEFLATED) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", method) as archive:
        archive.writestr(name, content)
    return file.getvalue()


def npy_header(text: str, version: bytes = b"\x01\x00") -> bytes:
    return b"\x93NUMPY" + version + struct.pack("<H", len(text)) + text.encode()


def patched(content: bytes, at: int, form: str, value: int | float) -> bytes:
    """The content with a number replaced."""
    packed = struct.pack(form, value)
    return content[:at] + packed + content[at + len(packed) :]


COMPRESSED = pcd("binary_compressed")
SIZES_AT = COMPRESSED.index(b"binary_compressed\n") + len(b"binary_compressed\n")
MANY = str(10**17).encode()
LAS, LAZ = las(), las(compressed=True)


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
    "e57 ends within its XML": whole_e57(e57()[:2048]),
    "e57 one point more": whole_e57(e57().replace(b'recordCount="40"', b'recordCount="41"')),
    "e57 XML cut in a tag": whole_e57(e57().replace(b"<vectorChild ", b"<vectorChild<", 1)),
    "e57 kind unknown": whole_e57(e57().replace(b'"CompressedVector"', b'"CompressedSector"')),
    "e57 points elsewhere": whole_e57(e57().replace(b'fileOffset="48"', b'fileOffset="99"')),
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
    "UTF-32": text_rows(POINTS).decode().encode("utf-32"),
    "hex and underscores": b"0x10 0x20 0x30\n1_0 2_0 3_0\n",
    "text count 1e17": MANY + b"\n" + text_rows(POINTS),
    "stl triangles 4e9": patched(stl_binary(), 80, "<I", 4_000_000_000),
    "stl one more": patched(stl_binary(), 80, "<I", 14),
    "ptx rows 1e9": ptx().replace(b"10\n4\n", b"999999999\n4\n", 1),
    "ptx one more row": ptx().replace(b"10\n4\n", b"11\n4\n", 1),
    "off counts 4e9": b"OFF\n4000000000 0 0\n1 2 3\n",
    "off counts words": b"OFF\nmany many many\n1 2 3\n",
    "obj vertex of words": b"v one two three\n",
    "gltf nested": b'{"asset": ' + b"[" * 100_000,
    "gzip of zeros": gzip.compress(bytes(50_000_000), mtime=0),
    "zip of zeros": zip_of("a.ply", bytes(50_000_000)),
}


HUGE = {
    "long line": b"ply\n" + b"comment " + b"x" * 2_000_000 + b"\n" + ply()[4:],
    "many lines": b"ply\n" + b"comment x\n" * 100_000 + ply()[4:],
    "many properties": ply().replace(
        b"property float z\n",
        b"property float z\n" + b"".join(b"property float p%d\n" % i for i in range(300)),
    ),
    "pcd comments": b"# comment\n" * 100_000 + pcd(),
    "pcd fields": pcd().replace(b"FIELDS ", b"FIELDS " + b"a " * 1000),
    "wide row": b"1 2 3" + b" 4" * 100_000 + b"\n",
    "endless line": b"1 2 3\n" + b"4" * 1_000_000,
    "long header": b"# x\n" * 3000 + text_rows(POINTS),
}
