"""Registration of files far larger than the memory allowed: time, memory and error.

``python -m benchmarks.large [POINTS [KIND ...]]``: files of POINTS points (1e9 by default, a PLY of
12 GB) against a PLY of a tenth of that, moved, in 2 GiB; the moved source is written as PLY, that
of LAS and LAZ as such, and read again. Kinds: ply, las, laz, xyz, npy, vtk. The files lie in the
folder of temporary files (TMPDIR), and are removed at the end.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

import laspy
import numpy as np
from numpy.typing import NDArray

from service.formats import DecodedCloud, ReadLimits, read_pieces

MEMORY_BYTES = 2 << 30
BLOCK, REPEATED = 4_000_000, 6
ANGLE = np.radians(40)
R = np.array([[np.cos(ANGLE), -np.sin(ANGLE), 0], [np.sin(ANGLE), np.cos(ANGLE), 0], [0, 0, 1]])
SHIFT = np.array([30.0, -12.0, 4.0])


def main() -> None:
    """Write the files, register each kind in a process of bounded memory, print the figures."""
    count = int(float(sys.argv[1])) if len(sys.argv) > 1 else 10**9
    kinds = sys.argv[2:] or ["ply"]
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "target.ply"
        write_ply(target, count // 10, seed=1, moved=True)
        for kind in kinds:
            source = Path(folder) / f"source.{kind}"
            moved = Path(folder) / f"moved.{kind if kind in ('las', 'laz') else 'ply'}"
            started = time.perf_counter()
            WRITERS[kind](source, count, seed=0)
            print(f"{kind}: {source.stat().st_size / 1e9:.2f} GB", end=", ")
            print(f"written in {time.perf_counter() - started:.0f} s", flush=True)
            print(_register(source, target, moved), flush=True)
            source.unlink()
            print(f"  {_describe(moved, count)}", flush=True)
            moved.unlink()


def _register(source: Path, target: Path, moved: Path) -> str:
    """Register in a process whose address space is bounded; describe what it took."""
    command = [sys.executable, "-m", "service.cli", "align", str(source), str(target), "--json"]
    command += ["-o", str(moved)]
    started = time.perf_counter()
    done = subprocess.run(
        command,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES)),
        capture_output=True,
        text=True,
        check=False,
    )
    seconds = time.perf_counter() - started
    if done.returncode:
        return f"  failed: {done.stderr[-300:]}"
    found = json.loads(done.stdout)
    T = np.array(found["transform"])
    angle = np.degrees(np.linalg.norm(T[:3, :3] - R) / np.sqrt(2))
    shift = np.linalg.norm(T[:3, 3] - SHIFT)
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 2**20
    return (
        f"  {seconds:.0f} s, {peak:.2f} GiB at most, accepted {found['accepted']}, "
        f"off by {angle:.4f} degrees and {shift:.4f}\n  {done.stderr.strip()}"
    )


def _describe(moved: Path, count: int) -> str:
    """Tell how far the mean of the moved file is from that of the scene, turned."""
    written = _sum_points(read_pieces(moved, ReadLimits(max_points=BLOCK)))
    expected = _sum_points(DecodedCloud(points, "ply") for points in iter_scene(count, seed=0))
    distance = np.linalg.norm(written / count - (R @ (expected / count) + SHIFT))
    return f"moved file: {moved.stat().st_size / 1e9:.2f} GB, its mean off by {distance:.4f}"


def _sum_points(pieces: Iterable[DecodedCloud]) -> NDArray[np.float64]:
    return np.sum([piece.points.sum(axis=0, dtype=np.float64) for piece in pieces], axis=0)


def iter_scene(count: int, seed: int, *, moved: bool = False) -> Iterator[NDArray[np.float32]]:
    """Yield blocks of points; from block REPEATED on those before come again, shifted a little."""
    rng = np.random.default_rng(seed)
    blocks: list[NDArray[np.float32]] = []
    for number, start in enumerate(range(0, count, BLOCK)):
        if number < REPEATED:
            points = _draw_block(rng)
            blocks.append((points @ R.T + SHIFT).astype(np.float32) if moved else points)
        shift = np.float32(rng.normal(0, 0.02, 3) * (number >= REPEATED))
        yield blocks[number % REPEATED][: count - start] + shift


def _draw_block(rng: np.random.Generator) -> NDArray[np.float32]:
    """Draw points of a hilly ground of 200 by 200 with houses."""
    points = np.empty((BLOCK, 3), np.float32)
    points[:, :2] = rng.random((BLOCK, 2), np.float32) * 200 - 100
    x, y = points[:, 0], points[:, 1]
    points[:, 2] = 3 * np.sin(x / 17) + 2 * np.cos(y / 11 + x / 40) + 0.02 * y
    for centre_x, centre_y, width, height in HOUSES:
        inside = (np.abs(x - centre_x) < width) & (np.abs(y - centre_y) < width / 2)
        points[inside, 2] = height
    points[:, 2] += rng.standard_normal(BLOCK, np.float32) * np.float32(0.02)
    return points


HOUSES = [(-60, 20, 12, 9), (35, -40, 8, 14), (10, 55, 15, 7), (70, 30, 6, 11), (-20, -70, 10, 12)]


def write_ply(path: Path, count: int, seed: int, *, moved: bool = False) -> None:
    """Write float32 points."""
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {count}\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz") + "end_header\n"
    with path.open("wb") as file:
        file.write(header.encode())
        for points in iter_scene(count, seed, moved=moved):
            file.write(points.tobytes())


def write_las(path: Path, count: int, seed: int) -> None:
    """Write points of 20 bytes, or compressed where the name ends in .laz."""
    header = laspy.LasHeader(point_format=0, version="1.4")
    header.scales, header.offsets = np.full(3, 0.001), np.zeros(3)
    with laspy.open(path, "w", header=header, laz_backend=laspy.LazBackend.Lazrs) as file:
        for points in iter_scene(count, seed):
            record = laspy.ScaleAwarePointRecord.zeros(len(points), header=header)
            record.x, record.y, record.z = points.T.astype(np.float64)
            file.write_points(record)


def write_text(path: Path, count: int, seed: int) -> None:
    """Write a line a point, with millimetres."""
    with path.open("wb") as file:
        for points in iter_scene(count, seed):
            np.savetxt(file, points, fmt="%.3f")


def write_npy(path: Path, count: int, seed: int) -> None:
    """Write a float32 array."""
    with path.open("wb") as file:
        layout = {"descr": "<f4", "fortran_order": False, "shape": (count, 3)}
        np.lib.format.write_array_header_1_0(file, layout)
        for points in iter_scene(count, seed):
            file.write(points.tobytes())


def write_vtk(path: Path, count: int, seed: int) -> None:
    """Write poly data in binary."""
    head = f"# vtk DataFile Version 3.0\n\nBINARY\nDATASET POLYDATA\nPOINTS {count} float\n"
    with path.open("wb") as file:
        file.write(head.encode())
        for points in iter_scene(count, seed):
            file.write(points.astype(">f4").tobytes())


WRITERS = {
    "ply": write_ply,
    "las": write_las,
    "laz": write_las,
    "xyz": write_text,
    "npy": write_npy,
    "vtk": write_vtk,
}


if __name__ == "__main__":
    main()
