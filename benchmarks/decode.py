"""Seconds to decode a million points of each format, beside other libraries.

``python -m benchmarks.decode``; libraries that are not installed (pandas) are left out.
"""

from __future__ import annotations

import io
import tempfile
import time
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path

import laspy
import numpy as np
from numpy.typing import NDArray

from service.formats import read_points, write_ply

COUNT = 1_000_000
REPEATS = 3
Array = NDArray[np.float32]


def main() -> None:
    """Write and decode a cloud in each format; print sizes, seconds, and those of others."""
    points = np.random.default_rng(0).normal(0, 10, (COUNT, 3)).astype(np.float32)
    print(f"{COUNT} points, best of {REPEATS}")
    with tempfile.TemporaryDirectory() as folder:
        for name, write in WRITERS.items():
            path = Path(folder) / f"cloud.{name[:3].lower()}"
            write(path, points)
            best = _best(lambda path: len(read_points(path).points), path)
            others = "".join(
                f"{library:>12}{seconds:9.3f} s" for library, seconds in _others(name, path)
            )
            print(f"{name:24}{path.stat().st_size / 1e6:8.1f} MB{best:9.3f} s{others}")


def _others(name: str, path: Path) -> Iterator[tuple[str, float]]:
    """Yield the seconds of the other libraries that read the format."""
    for library, formats, read in OTHERS:
        if not name.startswith(formats):
            continue
        try:
            import_module(library)
        except ImportError:
            continue
        yield library, _best(read, path)


def _best(read: Callable[[Path], int], path: Path) -> float:
    return min(_seconds(read, path) for _ in range(REPEATS))


def _seconds(read: Callable[[Path], int], path: Path) -> float:
    started = time.perf_counter()
    assert read(path) == COUNT
    return time.perf_counter() - started


def _open3d(path: Path) -> int:
    return len(import_module("open3d").io.read_point_cloud(str(path)).points)


def _laspy(path: Path) -> int:
    return len(laspy.read(path, laz_backend=laspy.LazBackend.Lazrs).xyz)


def _pandas(path: Path) -> int:
    return len(import_module("pandas").read_csv(path, sep=" ", header=None).to_numpy())


def _numpy_rows(path: Path) -> int:
    """Read the rows after a header of known length, as readers by numpy alone do."""
    with path.open("rb") as file:
        file.seek(path.stat().st_size - 12 * COUNT)
        return len(np.fromfile(file, "<f4").reshape(-1, 3).copy())


def _numpy(path: Path) -> int:
    return len(np.load(path))


OTHERS: tuple[tuple[str, tuple[str, ...], Callable[[Path], int]], ...] = (
    ("open3d", ("PLY", "PCD", "XYZ"), _open3d),
    ("pandas", ("XYZ",), _pandas),
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


WRITERS: dict[str, Callable[[Path, Array], object]] = {
    "PLY, binary": write_ply,
    "PLY, binary, big-endian": _big_endian_ply,
    "PLY, ASCII": _ascii_ply,
    "PCD, binary": _pcd,
    "XYZ": lambda path, points: path.write_bytes(_text(points)),
    "NPY": _npy,
    "LAS": _las,
    "LAZ": lambda path, points: _las(path, points, compressed=True),
}


if __name__ == "__main__":
    main()
