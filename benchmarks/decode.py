"""Seconds to decode two million points of each format, beside other libraries, in the same run.

``python -m benchmarks.decode [COUNT]``; libraries that are not installed (pandas) are left out. The
readers of a file take turns, and the fastest of their turns counts.
"""

from __future__ import annotations

import io
import sys
import tempfile
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import h5py
import laspy
import numpy as np
from numpy.typing import NDArray

from service.formats import DecodedCloud, read_points, write_cloud, write_ply

COUNT = int(float(sys.argv[1])) if len(sys.argv) > 1 else 2_000_000
REPEATS = 3
Array = NDArray[np.float32]
Read = Callable[[Path], int]
"""Reads a file, and returns its number of points."""


def main() -> None:
    """Write and decode a cloud in each format; print sizes, seconds, and those of others."""
    points = np.random.default_rng(0).normal(0, 10, (COUNT, 3)).astype(np.float32)
    print(f"{COUNT} points, best of {REPEATS} turns")
    with tempfile.TemporaryDirectory() as folder:
        for name, (suffix, write) in WRITERS.items():
            path = Path(folder) / f"cloud.{suffix}"
            write(path, points)
            seconds = _measure(_readers(name), path)
            listed = "".join(f"{reader:>12}{best:9.3f} s" for reader, best in seconds.items())
            print(f"{name:24}{path.stat().st_size / 1e6:8.1f} MB{listed}", flush=True)
            path.unlink()


def _readers(name: str) -> dict[str, Read]:
    """Return our reader, and those of the libraries that are installed."""
    others = {
        library: read
        for library, formats, read in OTHERS
        if name.startswith(formats) and find_spec(library) is not None
    }
    return {"mpe": lambda path: len(read_points(path).points)} | others


def _measure(readers: dict[str, Read], path: Path) -> dict[str, float]:
    """Return the fewest seconds of each reader; they take turns, so that all meet the same load."""
    turns = [{name: _seconds(read, path) for name, read in readers.items()} for _ in range(REPEATS)]
    return {name: min(turn[name] for turn in turns) for name in readers}


def _seconds(read: Read, path: Path) -> float:
    started = time.perf_counter()
    assert read(path) == COUNT
    return time.perf_counter() - started


def _import(name: str) -> Any:
    from importlib import import_module

    return import_module(name)


def _open3d(path: Path) -> int:
    return len(_import("open3d").io.read_point_cloud(str(path)).points)


def _laspy(path: Path) -> int:
    return len(laspy.read(path, laz_backend=laspy.LazBackend.Lazrs).xyz)


def _pandas(path: Path) -> int:
    return len(_import("pandas").read_csv(path, sep=" ", header=None).to_numpy())


def _pandas_csv(path: Path) -> int:
    return len(_import("pandas").read_csv(path).to_numpy())


def _trimesh(path: Path) -> int:
    return len(_import("trimesh").load(path, process=False).vertices)


def _h5py(path: Path) -> int:
    with h5py.File(path) as file:
        return len(file["points"][()])


def _pye57(path: Path) -> int:
    return len(_import("pye57").E57(str(path)).read_scan_raw(0)["cartesianX"])


def _numpy_rows(path: Path) -> int:
    """Read the rows after a header of known length, as readers by numpy alone do."""
    with path.open("rb") as file:
        file.seek(path.stat().st_size - 12 * COUNT)
        return len(np.fromfile(file, "<f4").reshape(-1, 3).copy())


def _numpy(path: Path) -> int:
    return len(np.load(path))


OTHERS: tuple[tuple[str, tuple[str, ...], Read], ...] = (
    ("open3d", ("PLY", "PCD", "XYZ"), _open3d),
    ("pandas", ("XYZ",), _pandas),
    ("pandas", ("CSV",), _pandas_csv),
    ("trimesh", ("OFF",), _trimesh),
    ("h5py", ("HDF5",), _h5py),
    ("pye57", ("E57",), _pye57),
    ("laspy", ("LAS", "LAZ"), _laspy),
    ("numpy", ("NPY",), _numpy),
    ("numpy", ("PLY, binary", "PCD, binary"), _numpy_rows),
)
"""Library, the formats that it reads, and the reader that returns the number of points."""


def _text(points: Array) -> bytes:
    file = io.BytesIO()
    np.savetxt(file, points, fmt="%.6f")
    return file.getvalue()


def _ascii_ply(path: Path, points: Array) -> None:
    header = f"ply\nformat ascii 1.0\nelement vertex {COUNT}\n"
    header += "".join(f"property float {name}\n" for name in "xyz") + "end_header\n"
    path.write_bytes(header.encode() + _text(points))


def _big_endian_ply(path: Path, points: Array) -> None:
    header = f"ply\nformat binary_big_endian 1.0\nelement vertex {COUNT}\n"
    header += "".join(f"property float {name}\n" for name in "xyz") + "end_header\n"
    path.write_bytes(header.encode() + points.astype(">f4").tobytes())


def _pcd(path: Path, points: Array) -> None:
    header = f"VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH {COUNT}\nHEIGHT 1\n"
    path.write_bytes(header.encode() + b"DATA binary\n" + points.tobytes())


def _npy(path: Path, points: Array) -> None:
    with path.open("wb") as file:
        np.save(file, points)


def _las(path: Path, points: Array, *, compressed: bool = False) -> None:
    header = laspy.LasHeader(point_format=3, version="1.2")
    header.scales = np.full(3, 0.0001)
    data = laspy.LasData(header)
    data.x, data.y, data.z = points.T
    with path.open("wb") as file:
        data.write(file, do_compress=compressed, laz_backend=laspy.LazBackend.Lazrs)


def _csv(path: Path, points: Array) -> None:
    """Seven columns with names, as a scanner's program exports them."""
    table = np.hstack([points, np.random.default_rng(1).integers(0, 256, (len(points), 4))])
    with path.open("w") as file:
        form = ["%.6f"] * 3 + ["%d"] * 4
        np.savetxt(file, table, form, ",", header="x,y,z,intensity,red,green,blue", comments="")


def _off(path: Path, points: Array) -> None:
    path.write_bytes(f"OFF\n{COUNT} 0 0\n".encode() + _text(points))


def _ptx(path: Path, points: Array) -> None:
    head = f"{COUNT}\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"
    path.write_bytes(head.encode() + _text(points).replace(b"\n", b" 0.5\n"))


def _vtk(path: Path, points: Array) -> None:
    head = f"# vtk DataFile Version 3.0\n\nBINARY\nDATASET POLYDATA\nPOINTS {COUNT} float\n"
    path.write_bytes(head.encode() + points.astype(">f4").tobytes())


def _hdf5(path: Path, points: Array) -> None:
    with h5py.File(path, "w") as file:
        file["points"] = points


def _e57(path: Path, points: Array) -> None:
    write_cloud(path, "e57", DecodedCloud(points, "e57"))


WRITERS: dict[str, tuple[str, Callable[[Path, Array], object]]] = {
    "PLY, binary": ("ply", write_ply),
    "PLY, binary, big-endian": ("ply", _big_endian_ply),
    "PLY, ASCII": ("ply", _ascii_ply),
    "PCD, binary": ("pcd", _pcd),
    "XYZ": ("xyz", lambda path, points: path.write_bytes(_text(points))),
    "CSV, seven columns": ("csv", _csv),
    "OFF": ("off", _off),
    "PTX": ("ptx", _ptx),
    "NPY": ("npy", _npy),
    "HDF5": ("h5", _hdf5),
    "VTK, binary": ("vtk", _vtk),
    "E57": ("e57", _e57),
    "LAS": ("las", _las),
    "LAZ": ("laz", lambda path, points: _las(path, points, compressed=True)),
}
"""Suffix and writer of each kind of file."""


if __name__ == "__main__":
    main()
