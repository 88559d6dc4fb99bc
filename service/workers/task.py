"""What the service process hands to a child; light enough to be imported on both sides."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from service.clouds.inputs import CloudInput
from service.outbound import FetchRules
from service.workers.sandbox.limits import Limits


@dataclass(frozen=True, slots=True)
class FetchTask:
    """All that is needed to fetch the clouds of a job that are not here yet."""

    job_id: str
    tenant: str
    source: CloudInput
    target: CloudInput
    data_dir: Path
    scratch: Path
    limits: Limits
    rules: FetchRules


@dataclass(frozen=True, slots=True)
class Task:
    """All that is needed to decode and register two clouds that are here."""

    job_id: str
    tenant: str
    source: CloudInput
    target: CloudInput
    options: dict[str, Any]
    data_dir: Path
    scratch: Path
    threads: int
    limits: Limits
