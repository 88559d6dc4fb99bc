"""HDF5 and MATLAB files: arrays by their names, and nothing outside of the file."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray

from service.formats import CloudFileError, DecodedCloud, ReadLimits, read_points
from tests.factories.array_files import Arrays, hdf5, matlab, matlab_73, packed
from tests.factories.cloud_files import NORMALS, POINTS, npz

INTENSITY = np.arange(len(POINTS)) % 7
ARRAYS = {"points": POINTS, "normals": NORMALS, "intensity": INTENSITY}


def packed_matlab(arrays: Arrays) -> bytes:
    return matlab(arrays, compressed=True)


def read(folder: Path, content: bytes, **choices: Any) -> DecodedCloud:
    (folder / "cloud").write_bytes(content)
    return read_points(folder / "cloud", **choices)


@pytest.mark.parametrize("make", [hdf5, packed, matlab, packed_matlab, matlab_73])
def test_arrays_are_found_by_their_names(tmp_path: Path, make: Callable[[Arrays], bytes]) -> None:
    cloud = read(tmp_path, make(ARRAYS), attributes=True)
    np.testing.assert_array_equal(cloud.points, POINTS)
    np.testing.assert_array_equal(cloud.normals, NORMALS)
    np.testing.assert_array_equal(cloud.attributes["intensity"], INTENSITY)
    weighted = read(tmp_path, make(ARRAYS), weights="intensity")
    np.testing.assert_array_equal(weighted.weights, INTENSITY)


@pytest.mark.parametrize(
    "content",
    [
        hdf5({"scan/xyz": POINTS, "other": INTENSITY}),
        hdf5({"whatever": POINTS}),
        matlab({"scan": {"xyz": POINTS, "label": "hall"}, "other": INTENSITY}),
        matlab({"whatever": POINTS, "name": "hall"}),
    ],
    ids=["group", "only", "structure", "only matrix"],
)
def test_folders_structures_and_single_arrays(tmp_path: Path, content: bytes) -> None:
    np.testing.assert_array_equal(read(tmp_path, content).points, POINTS)


def test_one_of_several_clouds_is_chosen(tmp_path: Path) -> None:
    """As ModelNet40 has them."""
    content = hdf5({"data": np.stack([POINTS, POINTS + 1]), "label": [[3], [5]]})
    with pytest.raises(CloudFileError, match=r"2 clouds of .* set 'scan'"):
        read(tmp_path, content)
    np.testing.assert_array_equal(read(tmp_path, content, scan=1).points, POINTS + 1)
    with pytest.raises(CloudFileError, match="scan 2 does not exist"):
        read(tmp_path, content, scan=2)


@pytest.mark.parametrize("make", [hdf5, matlab])
def test_unknown_names_are_listed(tmp_path: Path, make: Callable[[Arrays], bytes]) -> None:
    with pytest.raises(CloudFileError, match="'left', 'right'"):
        read(tmp_path, make({"left": POINTS, "right": POINTS}))


@pytest.mark.parametrize("make", [hdf5, matlab, matlab_73, lambda arrays: npz(**arrays)])
def test_an_array_is_chosen_by_its_name(tmp_path: Path, make: Callable[[Arrays], bytes]) -> None:
    content = make({"points": POINTS, "left": POINTS + 1})
    np.testing.assert_array_equal(read(tmp_path, content, array="left").points, POINTS + 1)
    with pytest.raises(CloudFileError, match="'right', as 'array' says"):
        read(tmp_path, content, array="right")
    with pytest.raises(CloudFileError, match="array is set, but the file is of format xyz"):
        read(tmp_path, b"1 2 3\n4 5 6\n", array="left")


@pytest.mark.parametrize("make", [hdf5, matlab, matlab_73, lambda arrays: npz(**arrays)])
def test_one_array_for_each_axis(tmp_path: Path, make: Callable[[Arrays], bytes]) -> None:
    arrays = dict(zip(("X", "Y", "Z"), POINTS.T, strict=True)) | {"intensity": INTENSITY}
    cloud = read(tmp_path, make(arrays), attributes=True)
    np.testing.assert_array_equal(cloud.points, POINTS)
    np.testing.assert_array_equal(cloud.attributes["intensity"], INTENSITY)
    with pytest.raises(CloudFileError, match="have the shapes"):
        read(tmp_path, make(arrays | {"Z": POINTS[:9, 2]}))


@pytest.mark.parametrize("make", [hdf5, matlab])
def test_arrays_beside_the_points_in_their_folder(
    tmp_path: Path, make: Callable[[Arrays], bytes]
) -> None:
    """As a structure with the names of MATLAB's pointCloud, and groups of HDF5."""
    cloud = {"Location": POINTS, "Normal": NORMALS, "Color": POINTS, "Intensity": INTENSITY}
    if make is hdf5:
        content = hdf5({f"scan/{name}": array for name, array in cloud.items()} | {"pose": [1, 2]})
    else:
        content = matlab({"scan": cloud, "pose": [1, 2]})
    found = read(tmp_path, content, attributes=True)
    np.testing.assert_array_equal(found.points, POINTS)
    np.testing.assert_array_equal(found.normals, NORMALS)
    assert list(found.attributes) == ["red", "green", "blue", "Intensity"]
    name = "scan/Intensity" if make is hdf5 else "scan.Intensity"
    weighted = read(tmp_path, content, attributes=True, weights=name)
    np.testing.assert_array_equal(weighted.weights, INTENSITY)
    assert list(weighted.attributes) == ["red", "green", "blue", name]


def test_normals_of_another_folder_are_attributes(tmp_path: Path) -> None:
    content = hdf5({"a/points": POINTS, "b/normals": NORMALS})
    found = read(tmp_path, content, attributes=True)
    assert found.normals is None
    assert next(iter(found.attributes)) == "b/normals:0"


def test_an_array_is_named_with_its_folder(tmp_path: Path) -> None:
    content = hdf5({"a/scan": POINTS, "b/scan": POINTS + 1, "c/points": POINTS + 2})
    np.testing.assert_array_equal(read(tmp_path, content).points, POINTS + 2)
    np.testing.assert_array_equal(read(tmp_path, content, array="b/scan").points, POINTS + 1)
    with pytest.raises(CloudFileError, match="'a/scan', 'b/scan'"):
        read(tmp_path, content, array="scan")


def external(path: Path) -> bytes:
    (path / "secret").write_bytes(bytes(240))
    content = io.BytesIO()
    with h5py.File(content, "w") as file:
        outside = [(str(path / "secret"), 0, 240)]
        file.create_dataset("points", (10, 3), "f8", external=outside)
    return content.getvalue()


def linked(path: Path) -> bytes:
    (path / "secret.h5").write_bytes(hdf5({"points": POINTS}))
    content = io.BytesIO()
    with h5py.File(content, "w") as file:
        file["points"] = h5py.ExternalLink(str(path / "secret.h5"), "/points")
    return content.getvalue()


@pytest.mark.parametrize("make", [external, linked])
def test_other_files_are_not_read(tmp_path: Path, make: Callable[[Path], bytes]) -> None:
    with pytest.raises(CloudFileError):
        read(tmp_path, make(tmp_path))


def unallocated() -> bytes:
    content = io.BytesIO()
    with h5py.File(content, "w") as file:
        file.create_dataset("points", (10**9, 3), "f8", chunks=(1000, 3))
    return content.getvalue()


def zeros(arrays: Callable[[Arrays], bytes]) -> bytes:
    table: NDArray[np.float64] = np.zeros((400_000, 3))
    return arrays({"points": table})


@pytest.mark.parametrize(
    "content", [unallocated(), zeros(packed), zeros(packed_matlab)], ids=["empty", "h5", "mat"]
)
def test_expansions_are_bounded(tmp_path: Path, content: bytes) -> None:
    with pytest.raises(CloudFileError, match=r"expands|limit"):
        read(tmp_path, content, limits=ReadLimits(max_points=10**10))


@pytest.mark.parametrize("make", [hdf5, matlab, packed_matlab])
def test_damage_is_an_error(tmp_path: Path, make: Callable[[Arrays], bytes]) -> None:
    content = make({"points": POINTS})
    rng = np.random.default_rng(0)
    for _ in range(60):
        damaged = bytearray(content[: int(rng.integers(len(content) // 2, len(content) + 1))])
        for place in rng.integers(0, len(damaged), 8):
            damaged[place] = int(rng.integers(256))
        try:
            cloud = read(tmp_path, bytes(damaged))
        except CloudFileError:
            continue
        assert cloud.points.shape[1] == 3
