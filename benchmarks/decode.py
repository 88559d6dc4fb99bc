"""Seconds to decode a million points of each format: python -m benchmarks.decode."""

from __future__ import annotations

import io
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import laspy
import numpy as np
from numpy.typing import NDArray

from service.formats import read_points, write_ply

COUNT = 1_000_000
REPEATS = 3
Array = NDArray[np.float32]


def main() -> None:
    """Write and decode a cloud in each format; print sizes and seconds."""
    points = np.random.default_rng(0).normal(0, 10, (COUNT, 3)).astype(np.float32)
    print(f"{COUNT} points, best of {REPEATS}")
    with tempfile.TemporaryDirectory() as folder:
        for name, write in WRITERS.items():
            path = Path(folder) / "cloud"
            write(path, points)
            best = min(_seconds(path) for _ in range(REPEATS))
            print(f"{name:24}{path.stat().st_size / 1e6:8.1f} MB{best:9.3f} s")


def _seconds(path: Path) -> float:
    started = time.perf_counter()
    assert len(read_points(path).points) == COUNT
    return time.perf_counter() - started


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
