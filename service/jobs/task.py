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
    source: CloudInput
    target: CloudInput
    options: dict[str, Any]
    data_dir: Path
    scratch: Path
    threads: int
    limits: Limits
    fetch_rules: FetchRules


def run(task: Task, connection: Connection) -> None:
    """Entry of the child process."""
    # here, not above: the service process must not load the kernels, the forkserver has them
    from service.jobs import attempt

    attempt.run(task, connection)


def ready(_: None, connection: Connection) -> None:
    """Entry of a child that does nothing: one that ends well shows that the forkserver is warm."""
    connection.send_bytes(b'{"ready": true}')
