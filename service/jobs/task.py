"""What the service process hands to a child; light enough to be imported on both sides."""

from __future__ import annotations

from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from service.jobs.confinement import Limits
from service.jobs.job import CloudInput
from service.sources import FetchRules


@dataclass(frozen=True, slots=True)
class Task:
    """All that one attempt needs to know."""

    job_id: str
    tenant: str
    source: CloudInput
    target: CloudInput
    options: dict[str, Any]
    data_dir: Path
    scratch: Path
    threads: int
    limits: Limits
    fetch_rules: FetchRules


def stand_by(connection: Connection) -> None:
    """Entry of the child process: waits for its task, then performs it."""
    # here, not above: the service process must not load the kernels, the forkserver has them
    from service.jobs import attempt

    attempt.stand_by(connection)
