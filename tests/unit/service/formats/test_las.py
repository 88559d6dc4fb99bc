"""LAS and LAZ files of real tools and by hand."""

from __future__ import annotations

import struct
from pathlib import Path

import laspy
import numpy as np
import pytest

from service.formats import read_points, write_cloud
from tests.factories.decoding import write_file
from tests.factories.scanner_files import DOUBLES, las

REAL = [
    ("formats/1.2-with-color.las", 1065, (3362.7, 4635.73, 179.79)),
    ("formats/autzen-thin.las", 10653, (3405.74, 4648.98, 187.14)),
]


@pytest.mark.real_data
@pytest.mark.parametrize(("name", "count", "extent"), REAL)
def test_files_of_real_tools(
    data: Path, name: str, count: int, extent: tuple[float, float, float]
) -> None:
    points = read_points(data / name).points
    assert points.shape == (count, 3)
    np.testing.assert_allclose(np.ptp(points, axis=0), extent, rtol=1e-5)


def las_15(*, compressed: bool) -> bytes:
    """LAS 1.4 with the 18 bytes that 1.5 adds to its header."""
    content = bytearray(las(compressed=compressed, version="1.4"))
    size, offset = struct.unpack_from("<HI", content, 94)
    content[25] = 5
    struct.pack_into("<HI", content, 94, size + 18, offset + 18)
    if compressed:
        struct.pack_into("<q", content, offset, struct.unpack_from("<q", content, offset)[0] + 18)
    return bytes(content[:size] + bytes(18) + content[size:])


@pytest.mark.parametrize("compressed", [False, True])
def test_las_15_is_read_and_written_as_14(tmp_path: Path, *, compressed: bool) -> None:
    cloud = read_points(write_file(tmp_path, las_15(compressed=compressed)), attributes=True)
    expected = DOUBLES + np.array([500_000.0, 4_000_000, 0])
    np.testing.assert_allclose(cloud.points, expected, rtol=0, atol=6e-4)
    write_cloud(tmp_path / "a.las", "las", cloud)
    with laspy.open(tmp_path / "a.las") as file:
        assert str(file.header.version) == "1.4"
