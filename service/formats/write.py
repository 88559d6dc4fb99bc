"""Writers of PLY, PCD, LAZ and NPY, with the attributes that each can hold."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.libraries import import_library

Attributes = Mapping[str, NDArray[np.generic]]
_PLY_TYPES = {
    "i1": "char", "u1": "uchar", "i2": "short", "u2": "ushort",
    "i4": "int", "u4": "uint", "f4": "float", "f8": "double",
}  # fmt: skip
_LAS_STEPS = 2_000_000_000
"""Steps of the scale across the extent; LAS stores 32-bit counts of it."""


def write_cloud(
    path: Path, format: str, points: NDArray[np.floating], attributes: Attributes
) -> None:
    """Write points and attributes in one of the formats of WRITERS.

    Parameters
    ----------
    path
        File to write.
    format
        Key of WRITERS.
    points
        (N, 3) coordinates.
    attributes
        (N,) columns by name.
    """
    WRITERS[format](path, points, attributes)


def write_ply(
    path: Path, points: NDArray[np.floating], attributes: Attributes | None = None
) -> None:
    """Write a binary little-endian PLY file; coordinates keep their precision.

    64-bit integers, which PLY lacks, become double.
    """
    narrow = {
        name.replace(" ", "_"): column if _type_code(column) in _PLY_TYPES else column.astype("f8")
        for name, column in (attributes or {}).items()
    }
    rows = _to_rows(points, narrow)
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}"]
    lines += [f"property {_PLY_TYPES[rows[n].dtype.str[1:]]} {n}" for n in rows.dtype.names or ()]
    with path.open("wb") as file:
        file.write("\n".join([*lines, "end_header\n"]).encode())
        file.write(rows.tobytes())


def write_pcd(path: Path, points: NDArray[np.floating], attributes: Attributes) -> None:
    """Write a binary PCD file."""
    rows = _to_rows(points, {name.replace(" ", "_"): c for name, c in attributes.items()})
    names = rows.dtype.names or ()
    codes = [rows[name].dtype.str[1:].upper() for name in names]
    lines = [
        "# .PCD v0.7 - Point Cloud Data file format",
        "VERSION 0.7",
        f"FIELDS {' '.join(names)}",
        f"SIZE {' '.join(code[1] for code in codes)}",
        f"TYPE {' '.join(code[0] for code in codes)}",
        f"COUNT {' '.join('1' for _ in codes)}",
        f"WIDTH {len(rows)}",
        "HEIGHT 1",
        "VIEWPOINT 0 0 0 1 0 0 0",
        f"POINTS {len(rows)}",
        "DATA binary\n",
    ]
    with path.open("wb") as file:
        file.write("\n".join(lines).encode())
        file.write(rows.tobytes())


def write_npy(path: Path, points: NDArray[np.floating], attributes: Attributes) -> None:
    """Write an (N, 3) array; with attributes a structured one with the fields x, y, z, ..."""
    with path.open("wb") as file:
        np.save(file, _to_rows(points, attributes) if attributes else points, allow_pickle=False)


def write_laz(path: Path, points: NDArray[np.floating], attributes: Attributes) -> None:
    """Write LAZ 1.4, point format 7; other attributes become extra dimensions.

    Non-finite points are left out: LAS cannot hold them.

    Raises
    ------
    MissingLibraryError
        laspy is not installed.
    """
    laspy = import_library("laspy")
    finite = np.isfinite(points).all(axis=1)
    points = points[finite].astype(np.float64)
    header = laspy.LasHeader(point_format=7, version="1.4")
    low, high = (points.min(axis=0), points.max(axis=0)) if len(points) else (np.zeros(3),) * 2
    header.offsets = np.round((low + high) / 2)
    header.scales = _scales(float((high - low).max()))
    own = set(header.point_format.dimension_names)
    extra = [name for name in attributes if name not in own]
    header.add_extra_dims(
        [laspy.ExtraBytesParams(name[:32], attributes[name].dtype) for name in extra]
    )
    data = laspy.LasData(header)
    data.x, data.y, data.z = points.T
    for name, column in attributes.items():
        data[name[:32]] = column[finite]
    with path.open("wb") as file:
        data.write(file, do_compress=True, laz_backend=laspy.LazBackend.Lazrs)


def _scales(extent: float) -> NDArray[np.float64]:
    """Return the smallest power of ten, at least 1e-9, that spans the extent in 32 bits."""
    needed = max(extent / _LAS_STEPS, 1e-9)
    return np.full(3, 10.0 ** np.ceil(np.log10(needed)))


def _to_rows(points: NDArray[np.floating], attributes: Attributes) -> NDArray[np.void]:
    """Build an (N,) structured little-endian array: x, y, z, then the attributes."""
    kind = "<f8" if points.dtype.itemsize > 4 else "<f4"
    columns = dict(zip("xyz", points.T, strict=True)) | {
        name: column for name, column in attributes.items() if name not in ("x", "y", "z")
    }
    layout = [
        (n, kind if n in ("x", "y", "z") else f"<{_type_code(c)}") for n, c in columns.items()
    ]
    rows = np.empty(len(points), np.dtype(layout))
    for name, column in columns.items():
        rows[name] = column
    return rows


def _type_code(column: NDArray[np.generic]) -> str:
    return column.dtype.str[1:]


WRITERS: dict[str, Callable[[Path, NDArray[np.floating], Attributes], None]] = {
    "ply": write_ply,
    "pcd": write_pcd,
    "laz": write_laz,
    "npy": write_npy,
}
"""Writers by the name of their format."""
