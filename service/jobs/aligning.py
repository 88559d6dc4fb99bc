"""The source in the target's frame as a file, made by a process of its own: it decodes clouds."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.formats import DecodedCloud, read_points, write_cloud
from service.formats.names import find_normals
from service.jobs.confinement import Limits, confine
from service.problems import JobTimeoutError, ServiceError

FINE = 1e-6
"""Share of the extent by which float32 may round; else the file is written in float64."""


@dataclass(frozen=True, slots=True)
class Alignment:
    """What is to be written; all of it fits into JSON."""

    transform: list[list[float]]
    source: str
    source_reading: dict[str, Any]
    target: str | None
    """File of the target, if it is merged in."""
    target_reading: dict[str, Any]
    format: str
    output: str
    memory_bytes: int
    timeout_s: float


def write_aligned(alignment: Alignment) -> None:
    """Write the file in a child process.

    Raises
    ------
    JobTimeoutError
        It took longer than allowed.
    ServiceError
        It failed; the child's last words are the reason.
    """
    try:
        done = subprocess.run(  # noqa: S603
            [sys.executable, "-m", __name__],
            input=json.dumps(asdict(alignment)),
            capture_output=True,
            text=True,
            timeout=alignment.timeout_s,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise JobTimeoutError(f"It took longer than {alignment.timeout_s:.0f} s.") from None
    if done.returncode:
        words = done.stderr.strip().splitlines()[-1:] or [f"exit code {done.returncode}"]
        raise ServiceError(f"The file could not be written: {words[0][:200]}")


def main() -> None:
    """The child: reads the alignment from its standard input."""
    wanted = Alignment(**json.load(sys.stdin))
    confine(Limits(memory_bytes=wanted.memory_bytes, cpu_s=int(wanted.timeout_s) + 10))
    source = read_points(wanted.source, **wanted.source_reading, attributes=True)
    moved = _moved(source, np.array(wanted.transform))
    if wanted.target is not None:
        target = read_points(wanted.target, **wanted.target_reading, attributes=True)
        moved = _merged(moved, (target.points.astype(np.float64), _attributes(target)))
    points, attributes = moved
    exact = source.points.dtype.itemsize > 4 or not _fits_float32(points)
    points = points if exact else points.astype(np.float32)
    write_cloud(Path(wanted.output), wanted.format, points, attributes)


Columns = tuple[NDArray[np.float64], dict[str, NDArray[np.generic]]]


def _moved(cloud: DecodedCloud, T: NDArray[np.float64]) -> Columns:
    """Points and attributes of the cloud after the transform, its normals turned with it."""
    attributes = _attributes(cloud)
    names = list(attributes)
    normals = find_normals(names)
    if normals is not None:
        turned = np.stack([attributes[names[i]] for i in normals], axis=1) @ T[:3, :3].T
        for column, place in enumerate(normals):
            kind = attributes[names[place]].dtype
            attributes[names[place]] = turned[:, column].astype(kind)
    return cloud.points.astype(np.float64) @ T[:3, :3].T + T[:3, 3], attributes


def _attributes(cloud: DecodedCloud) -> dict[str, NDArray[np.generic]]:
    if cloud.attributes or cloud.normals is None:
        return dict(cloud.attributes)
    return dict(zip(("nx", "ny", "nz"), cloud.normals.T, strict=True))


def _merged(source: Columns, target: Columns) -> Columns:
    """Source, then target; the attributes that both have, and "cloud": 0 of the source, 1."""
    common = [
        name
        for name, column in source[1].items()
        if name in target[1] and target[1][name].dtype == column.dtype
    ]
    attributes = {name: np.concatenate([source[1][name], target[1][name]]) for name in common}
    sizes = [len(source[0]), len(target[0])]
    attributes["cloud"] = np.repeat(np.array([0, 1], np.uint8), sizes)
    return np.concatenate([source[0], target[0]]), attributes


def _fits_float32(points: NDArray[np.float64]) -> bool:
    finite = points[np.isfinite(points).all(axis=1)]
    if len(finite) == 0:
        return True
    largest = np.float32(np.abs(finite).max())
    return bool(np.spacing(largest) <= FINE * np.ptp(finite, axis=0).max())


if __name__ == "__main__":
    main()
