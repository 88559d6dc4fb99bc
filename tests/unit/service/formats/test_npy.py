"""NumPy files: every shape and type, never a pickle, never a bomb."""

from __future__ import annotations

import pickle
import struct
from pathlib import Path

import numpy as np
import pytest

from service.formats import CloudFileError, FileLimitError, UnsupportedFileError, read_points
from tests.factories.cloud_files import NORMALS, POINTS, npy, npz
from tests.factories.decoding import decode, decode_frugally, reason_of_refusal, write_file
from tests.factories.hostile_files import zip_of


@pytest.mark.parametrize(
    "array",
    [
        POINTS.astype(">f8"),
        POINTS.astype(np.float16).astype(np.float64).astype(np.float16),
        np.asfortranarray(POINTS),
        POINTS.reshape(8, 5, 3),
        (POINTS * 1000).round().astype(np.int32),
        np.rec.fromarrays([*POINTS.T, NORMALS[:, 0]], names="x,y,z,intensity"),
    ],
    ids=["big endian", "half", "Fortran", "grid", "integers", "records"],
)
def test_numpy_arrays(tmp_path: Path, array: np.ndarray) -> None:
    expected = (
        np.stack([array[n] for n in "xyz"], axis=1) if array.dtype.names else array.reshape(-1, 3)
    )
    for content in (npy(array), npz(cloud=array)):
        points = decode(tmp_path, content).points
        assert points.dtype in (np.float32, np.float64)
        np.testing.assert_array_equal(points, expected)


def test_double_precision_survives(tmp_path: Path) -> None:
    points = POINTS.astype(np.float64) + np.array([500_000.000123, 4_000_000.000456, 0])
    np.testing.assert_array_equal(decode(tmp_path, npy(points)).points, points)


def test_ignored_columns_are_reported(tmp_path: Path) -> None:
    assert "columns after" in decode(tmp_path, npy(np.hstack([POINTS, NORMALS]))).warnings[0]


def test_few_rows_of_many_columns_are_coordinates(tmp_path: Path) -> None:
    for array in (POINTS.T, np.vstack([POINTS.T, np.ones(40)])):
        cloud = decode(tmp_path, npy(np.ascontiguousarray(array)))
        np.testing.assert_array_equal(cloud.points, POINTS)
        assert "transpose" in cloud.warnings[0]


def test_a_transformation_matrix_is_no_cloud(tmp_path: Path) -> None:
    with pytest.raises(UnsupportedFileError, match="matrix"):
        decode(tmp_path, npy(np.eye(4)))


@pytest.mark.parametrize(
    "array",
    [
        np.ones((48, 64), np.float32),
        np.ones((480, 64), np.uint16),
        np.ones((64, 512)),
        np.ones((48, 64, 3), np.uint8),
        np.ones((48, 64, 4), np.uint8),
    ],
)
def test_pictures_are_no_clouds(tmp_path: Path, array: np.ndarray) -> None:
    pixels = np.random.default_rng(0).uniform(0, 255, array.shape).astype(array.dtype)
    for content in (npy(pixels), npz(points=pixels)):
        with pytest.raises(UnsupportedFileError, match="pixels of a picture"):
            decode(tmp_path, content)


def test_many_numbers_of_each_point_are_no_picture(tmp_path: Path) -> None:
    assert len(decode(tmp_path, npy(np.ones((4000, 64), np.float32))).points) == 4000


def test_arrays_that_may_be_several_clouds_are_told(tmp_path: Path) -> None:
    assert "2 rows and 20 columns" in decode(tmp_path, npy(POINTS.reshape(2, 20, 3))).warnings[0]


def test_a_field_of_three_numbers_holds_the_points(tmp_path: Path) -> None:
    records = np.zeros(40, [("id", "i4"), ("position", "f4", 3), ("velocity", "f4", 3)])
    records["position"] = POINTS
    cloud = read_points(write_file(tmp_path, npy(records)), attributes=True)
    np.testing.assert_array_equal(cloud.points, POINTS)
    assert set(cloud.attributes) == {"id", *(f"velocity:{i}" for i in range(3))}


def test_pickles_beside_the_points_are_left_out(tmp_path: Path) -> None:
    about = np.array([{"made": "by hand"}], object)
    cloud = read_points(write_file(tmp_path, npz(points=POINTS, about=about)), attributes=True)
    assert "1 arrays beside 'points' are ignored" in cloud.warnings


UNCLEAR = {
    "complex numbers": (npy(POINTS.astype(np.complex64)), "complex64"),
    "two columns": (npy(POINTS[:, :2]), "(40, 2)"),
    "two unnamed arrays": (npz(a=POINTS, b=POINTS), "2 arrays ('a', 'b'); expected only one"),
    "normals of another cloud": (npz(points=POINTS, normals=NORMALS[:9]), "9 normals"),
}


@pytest.mark.parametrize("case", UNCLEAR)
def test_what_is_not_clear_is_an_error_that_names_the_place(tmp_path: Path, case: str) -> None:
    content, words = UNCLEAR[case]
    assert words in reason_of_refusal(tmp_path, content)


class _Pickle:
    def __reduce__(self) -> tuple[object, ...]:
        return (open, ("/tmp/mpe-unpickled", "w"))


def test_pickles_are_never_loaded(tmp_path: Path) -> None:
    array = np.array([_Pickle()], dtype=object)
    for content in (npy(array), npz(points=array), pickle.dumps(_Pickle())):
        assert isinstance(decode_frugally(tmp_path, content), CloudFileError)
    assert isinstance(decode_frugally(tmp_path, npy(array)), UnsupportedFileError)
    assert not Path("/tmp/mpe-unpickled").exists()


def test_bombs_are_refused_before_they_expand(tmp_path: Path) -> None:
    zeros = npy(np.zeros((3_000_000, 3)))
    bomb = zip_of("points.npy", zeros)
    assert len(bomb) < len(zeros) / 500
    found = decode_frugally(tmp_path, bomb)
    assert isinstance(found, FileLimitError)
    lying = bytearray(bomb)
    size = struct.pack("<I", len(zeros))
    for at in (bomb.find(size), bomb.rfind(size)):
        lying[at : at + 4] = struct.pack("<I", 1000)
    assert isinstance(decode_frugally(tmp_path, bytes(lying)), CloudFileError)


@pytest.mark.parametrize("shape", ["(True, 3)", "(2, True)"])
def test_a_truth_value_is_no_length(tmp_path: Path, shape: str) -> None:
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".encode()
    header += b" " * (117 - len(header)) + b"\n"
    content = b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + bytes(48)
    with pytest.raises(CloudFileError, match="shape"):
        read_points(write_file(tmp_path, content))


@pytest.mark.parametrize("columns", [(1, 1, 2), (3, 1, 1), (2, 2, 2)])
def test_a_coordinate_is_one_number(tmp_path: Path, columns: tuple[int, int, int]) -> None:
    fields = [(name, "f4", (n,)) for name, n in zip("xyz", columns, strict=True)]
    np.save(tmp_path / "cloud.npy", np.zeros(5, fields))
    with pytest.raises(CloudFileError, match="expected one number"):
        read_points(tmp_path / "cloud.npy")


@pytest.mark.filterwarnings("ignore:Stored array in format 3.0")
def test_names_in_utf8_are_read(tmp_path: Path) -> None:
    """NumPy writes version 3.0 for them."""
    kinds = [("x", "f8"), ("y", "f8"), ("z", "f8"), ("яркость", "f4")]
    np.save(tmp_path / "cloud.npy", np.array([(1, 2, 3, 4), (5, 6, 7, 8)], kinds))
    cloud = read_points(tmp_path / "cloud.npy", attributes=True)
    assert cloud.points.tolist() == [[1, 2, 3], [5, 6, 7]]
    assert cloud.attributes["яркость"].tolist() == [4, 8]
