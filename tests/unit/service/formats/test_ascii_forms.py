"""Text within formats of their own, as programs of other languages and careless ones write it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from service.formats import CloudFileError, ReadLimits, read_points, text_table
from tests.factories.cloud_files import POINTS, lzf_literals, text_rows
from tests.factories.decoding import decode, write_file
from tests.factories.scanner_files import stl_ascii

ROWS = text_rows(POINTS)
PLY = (
    b"ply\nformat ascii 1.0\nelement vertex 40\nproperty float x\nproperty float y\n"
    b"property float z\nend_header\n"
)
PCD = b"VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 40\nHEIGHT 1\nDATA ascii\n"
OFF = b"OFF\n40 0 0\n"
PTX = b"40\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"
FORMS = {
    "ply": (PLY, ROWS),
    "pcd": (PCD, ROWS),
    "off": (OFF, ROWS),
    "obj": (b"o made\n", b"".join(b"v " + row + b"\n" for row in ROWS.splitlines())),
    "ptx": (PTX, b"".join(row + b" 0.5\n" for row in ROWS.splitlines())),
    "stl": (b"", stl_ascii()),
}


@pytest.mark.parametrize("name", FORMS)
@pytest.mark.parametrize("least", [0, 1 << 60], ids=["kernel", "plain"])
@pytest.mark.parametrize("limits", [None, ReadLimits(max_points=16)], ids=["whole", "pieces"])
def test_decimal_commas_are_read_and_told(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    least: int,
    limits: ReadLimits | None,
) -> None:
    monkeypatch.setattr(text_table, "MIN_KERNEL_BYTES", least)
    header, body = FORMS[name]
    with_points = read_points(write_file(tmp_path, header + body), limits)
    with_commas = read_points(write_file(tmp_path, header + body.replace(b".", b",")), limits)
    np.testing.assert_array_equal(with_commas.points, with_points.points)
    assert set(with_commas.warnings) - set(with_points.warnings) == {
        "commas are read as decimal points"
    }
    half = len(body) // 2
    mixed = header + body[:half] + body[half:].replace(b".", b",")
    with pytest.raises(CloudFileError, match="some have commas"):
        read_points(write_file(tmp_path, mixed))


@pytest.mark.parametrize("name", ["ply", "pcd", "off"])
@pytest.mark.parametrize("limits", [None, ReadLimits(max_points=16)], ids=["whole", "pieces"])
def test_rows_beyond_the_announced_are_told(
    tmp_path: Path, name: str, limits: ReadLimits | None
) -> None:
    content = b"".join(FORMS[name])
    told = "2 lines after the last announced row are ignored"
    more = read_points(write_file(tmp_path, content + b"\n1 2 3\n# end\n4 5 6\n"), limits)
    assert told in more.warnings
    np.testing.assert_array_equal(
        more.points, read_points(write_file(tmp_path, content + b"\n\n# end\n"), limits).points
    )
    assert told not in read_points(write_file(tmp_path, content + b"\n# end\n"), limits).warnings


PACKED = lzf_literals(POINTS.T.tobytes())
BODIES = {
    "ply ascii": (PLY, ROWS),
    "ply binary": (PLY.replace(b"ascii", b"binary_little_endian"), POINTS.tobytes()),
    "ply big": (PLY.replace(b"ascii", b"binary_big_endian"), POINTS.astype(">f4").tobytes()),
    "pcd ascii": (PCD, ROWS),
    "pcd binary": (PCD.replace(b"ascii", b"binary"), POINTS.tobytes()),
    "pcd packed": (
        PCD.replace(b"ascii", b"binary_compressed"),
        np.array([len(PACKED), POINTS.nbytes], "<u4").tobytes() + PACKED,
    ),
}
AXES = b"float x\nproperty float y\nproperty float z"
HEADERS = {
    "CR": (b"\n", b"\r"),
    "CR LF": (b"\n", b"\r\n"),
    "other axes in PLY": (AXES, AXES.replace(b"float ", b"float p")),
    "directions in PLY": (
        AXES,
        b"float E\nproperty float N\nproperty float H",
    ),
    "one field in PCD": (b"x y z\nSIZE 4 4 4\nTYPE F F F\n", b"xyz\nSIZE 4\nTYPE F\nCOUNT 3\n"),
}


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("form", [*HEADERS, "other letters"])
def test_headers_of_other_writers(tmp_path: Path, form: str, body: str) -> None:
    header, rows = BODIES[body]
    if form == "other letters":
        header = header.swapcase().replace(b"x\n", b"X\n")
    else:
        header = header.replace(*HEADERS[form])
        rows = rows.replace(b"\n", b"\r") if form == "CR" and "ascii" in body else rows
    if form == "one field in PCD" and body == "pcd packed":  # its numbers are not apart
        rows = rows[:8] + lzf_literals(POINTS.tobytes())
    found = decode(tmp_path, header + rows)
    np.testing.assert_array_equal(found.points, POINTS)
    assert found.warnings == ()
