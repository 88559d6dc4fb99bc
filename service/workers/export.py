"""The source in the target's frame as a file, made by a process of its own: it decodes clouds."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from service.clouds.transform import merged, moved
from service.formats import read_points, write_cloud
from service.problems import JobTimeoutError, ServiceError
from service.workers.sandbox.limits import Limits, apply_limits
from service.workers.sandbox.seccomp import drop_network


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
    apply_limits(Limits(memory_bytes=wanted.memory_bytes, cpu_s=int(wanted.timeout_s) + 10))
    drop_network()
    source = read_points(wanted.source, **wanted.source_reading, attributes=True)
    cloud = moved(source, np.array(wanted.transform))
    if wanted.target is not None:
        target = read_points(wanted.target, **wanted.target_reading, attributes=True)
        cloud = merged(cloud, target)
    write_cloud(Path(wanted.output), wanted.format, cloud.points, cloud.attributes)


if __name__ == "__main__":
    main()
