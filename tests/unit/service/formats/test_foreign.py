"""Files of well-known formats that are not read are named, and no table of points is among them."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from service.formats import UnknownFormatError, sniff
from tests.factories.cloud_files import POINTS, text_rows
from tests.factories.decoding import decode


def old_tar(name: str, content: bytes) -> bytes:
    """An archive without the mark of POSIX; its header holds the sum of its bytes."""
    fields = name.encode().ljust(100, b"\0") + b"0000644\0" * 3
    fields += b"%011o\0" % len(content) + b"%011o\0" % 0
    padded = fields.ljust(512, b"\0")
    header = fields + b"%06o\0 " % (sum(padded) + 8 * ord(" "))
    return header.ljust(512, b"\0") + content.ljust(512, b"\0")


FOREIGN = {
    "DWG": b"AC1027" + bytes(200),
    "USD": b"#usda 1.0" + bytes(20),
    "STEP": b"ISO-10303-21;\nHEADER;\n",
    "git lfs pull": b"version https://git-lfs.github.com/spec/v1\noid sha256:" + b"a" * 64,
    "RIEGL": b"\x10\0\0\0\0\0\0\x0bRieglLMS" + bytes(200),
    "ESRI": b"ncols 3\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2 3\n4 5 6\n",
    "molecule": b"3\nwater\nO 0.0 0.0 0.1\nH 0.0 0.7 -0.4\nH 0.0 -0.7 -0.4\n",
    "MATLAB": b"x=[ 1 2 3\n4 5 6\n];\n",
    "molecule ": b"3\nwater\n8 0.0 0.0 0.1\n1 0.0 0.7 -0.4\n1 0.0 -0.7 -0.4\n",
    "COLMAP's list of images": b"# Image list with two lines of data\n1 1 0 0 0 1 2 3 1 a\n",
    "Bundler": b"# Bundle file v0.3\n1 2\n500 0 0\n1 0 0\n0 1 0\n",
    "Surfer grid": b"DSAA\n4 3\n0 1\n0 1\n0 5\n1 2 3 4\n1 2 3 4\n",
    "DXF": b"999\nby hand\n0\nSECTION\n2\nHEADER\n",
    "rows in brackets": b"[1.5, 2, 3]\n[4, 5, 6]\n",
    "JSON": b'{"points": [[1, 2, 3]]}',
    "HTML": b"\n<!doctype HTML><html>",
    "XML": b'<?xml version="1.0"?><Error><Code>AccessDenied</Code></Error>',
    "Fortran": b"1.5D+02 2.5D+00 3D+00\n",
    "thousands": b"x;y;z\n1.234.567,5;2;3\n",
    "Python pickle": b"\x80\x04\x95" + bytes(9),
    "tar archive": b"a.ply".ljust(257, b"\0") + b"ustar\x0000",
    "NetCDF": b"CDF\x01" + bytes(20),
    "COLLADA": b'<?xml version="1.0"?>\n<COLLADA>\n',
    "tar archive ": old_tar("a.xyz", b"1 2 3\n"),
    "shapefile": b"\0\0\x27\x0a" + bytes(96),
    "a picture": b"P5\n# made by hand\n4 3\n65535\n" + bytes(24),
    "a picture ": b"P2\n4 3\n255\n1 2 3 4\n5 6 7 8\n9 8 7 6\n",
    "a picture  ": b"Pf\n4 3\n-1.0\n" + bytes(48),
    "a picture   ": b"BM" + bytes(60),
    "OpenEXR": b"v/1\x01\x02\0\0\0channels\0",
    "video": b"RIFF" + bytes(4) + b"AVI LIST",
    "medical": bytes(128) + b"DICM" + bytes(9),
    "3DS": b"MM" + bytes(4) + b"\x02\0" + bytes(9),
    "G-code": b";FLAVOR:Marlin\nG28\nG1 F1200 X1.5 Y2 Z0.2 E0.1\nG1 X2 Y2\n",
    "G-code ": b"%\nO1000\nN10 G21\nN20 G0 X1.5 Y2 Z3\n",
    "universal file": b"    -1\n  2411\n         1         1\n",
    "GSI": b"*110001+0000000000000A1 81..10+00000000001500 82..10+00000000002500\n",
    "ksplat": struct.pack("<4B4IH", 0, 1, 0, 0, 2, 1, 900, 900, 1).ljust(5000, b"\1"),
    "program": b"\x7fELF\x02" + bytes(90),
    "YAML": b"points:\n  - [1.5, 2, 3]\n  - [4, 5, 6]\n",
    "NMEA": b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\n",
    "YAML ": b'header:\n  seq: 1\n  frame_id: "map"\npoints:\n  -\n    x: 1.5\n    y: 2\n',
    "YAML  ": b"header:\n  frame_id: map\nheight: 1\nfields:\n- name: x\n  offset: 0\n",
    "a name beside each number": b"x=1.5 y=2 z=3\nx=4 y=5 z=6\n",
    "numbers of a program": b"1.5f 2.0f 3.0f\n4.0f 5.0f 6.0f\n",
}


@pytest.mark.parametrize("name", FOREIGN)
def test_foreign_files_are_named(tmp_path: Path, name: str) -> None:
    assert sniff(FOREIGN[name]) is None
    with pytest.raises(UnknownFormatError, match=name.strip()):
        decode(tmp_path, FOREIGN[name])


@pytest.mark.parametrize(
    "label", ["P1", "P6", "BM1", "MZ2", "ID3", "AC1015", "ORC", "RIFF", "G1", "N10", "root", "PAR1"]
)
def test_labels_of_points_are_no_marks_of_formats(tmp_path: Path, label: str) -> None:
    for delimiter in (" ", ","):
        lines = text_rows(POINTS, delimiter).decode().splitlines()
        content = "".join(f"{label}{delimiter}{line}\n" for line in lines).encode()
        points = decode(tmp_path, content).points.astype(np.float32)
        np.testing.assert_array_equal(points, POINTS)
