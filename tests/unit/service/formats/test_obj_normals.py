"""Normals of OBJ files: of the vertices they are kept, of the faces they are told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from service.formats import DecodedCloud, ReadLimits, read_pieces, read_points
from tests.factories.decoding import write_file

CORNERS = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
NORMALS = "vn 1 0 0\nvn 0 1 0\nvn 0 0.6 0.8\nvn 0.6 0 0.8\n"
LISTED = np.array([[1, 0, 0], [0, 1, 0], [0, 0.6, 0.8], [0.6, 0, 0.8]])


def read(tmp_path: Path, content: str) -> tuple[DecodedCloud, NDArray[np.generic] | None]:
    cloud = read_points(write_file(tmp_path, content.encode()), attributes=True)
    if "nx" not in cloud.attributes:
        return cloud, None
    return cloud, np.stack([cloud.attributes[name] for name in ("nx", "ny", "nz")], axis=1)


def test_normals_of_points_are_in_their_order(tmp_path: Path) -> None:
    lines = zip(NORMALS.splitlines(), CORNERS.splitlines(), strict=True)
    each_before = "".join(f"{normal}\n{corner}\n" for normal, corner in lines)  # as MeshLab writes
    in_order = CORNERS + NORMALS
    with_faces = [in_order + faces for faces in ("", "f 1 2 3\n", "f 1//1 2//2 3//3\n")]
    for content in (*with_faces, NORMALS + CORNERS, each_before):
        cloud, normals = read(tmp_path, content)
        np.testing.assert_array_equal(normals, LISTED)
        assert not cloud.warnings


def test_faces_assign_the_normals(tmp_path: Path) -> None:
    for faces in (
        "f 1//4 2//3 3//2\nf 1//4 3//2 4//1\n",
        "f 1/9/-1 2/9/-2 3/9/-3\nf -1//1 2//3 1//4\n",
    ):
        cloud, normals = read(tmp_path, CORNERS + NORMALS + faces)
        np.testing.assert_array_equal(normals, LISTED[::-1])
        assert cloud.faces is not None
        assert not cloud.warnings


def test_faces_may_stand_before_the_normals(tmp_path: Path) -> None:
    _, normals = read(tmp_path, CORNERS + "f 1//4 2//3 3//2\nf 1//4 3//2 4//1\n" + NORMALS)
    np.testing.assert_array_equal(normals, LISTED[::-1])


def test_vertices_without_a_normal(tmp_path: Path) -> None:
    _, normals = read(tmp_path, CORNERS + "vn 0 0 1\nf 1//1 2//1 3//1\n")
    np.testing.assert_array_equal(normals, [[0, 0, 1], [0, 0, 1], [0, 0, 1], [0, 0, 0]])


@pytest.mark.parametrize(
    ("lines", "reason"),
    [
        (NORMALS + "f 1//1 2//2 3//3\nf 1//4 3//3 4//4\n", "some vertices have several"),
        ("vn 0 0 1\nf 1 2 3\n", "not every corner of the faces has one"),
        (NORMALS + "f 1//1 2//2 3//3\nf 1 3 4\n", "not every corner"),
        ("vn 0 0 1\nvn 1 0 0\n", "not every corner"),
        (NORMALS + "f 1//1 2//2 3//5\n", "does not exist"),
        (NORMALS + "f 1//1 2//2 3//3\nf 9//1 1//1\n", "does not exist"),
        ("vn 0 0\n", "field"),
    ],
)
def test_normals_that_are_not_kept_are_told(tmp_path: Path, lines: str, reason: str) -> None:
    cloud, normals = read(tmp_path, CORNERS + lines)
    assert normals is None
    assert len(cloud.points) == 4
    (warning,) = cloud.warnings
    assert warning.startswith("the normals (vn) are not kept")
    assert reason in warning


def test_large_files_tell_it(tmp_path: Path) -> None:
    path = write_file(tmp_path, (CORNERS * 10 + NORMALS * 10).encode())
    *_, last = read_pieces(path, ReadLimits(max_points=16), attributes=True)
    assert "the normals (vn) are not kept, because the file is large" in last.warnings


def test_other_numbers_of_vertices_are_told(tmp_path: Path) -> None:
    for numbers, is_told in (("", False), (" 1.0", False), (" 1 0 0", False), (" 1 0 0 1", True)):
        path = write_file(tmp_path, f"v 0 0 1{numbers}\n".encode() * 20)
        *_, large = read_pieces(path, ReadLimits(max_points=16), attributes=True)
        for cloud in (large, read_points(path, attributes=True)):
            assert ("4 numbers behind the coordinates" in " ".join(cloud.warnings)) == is_told
