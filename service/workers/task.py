"""Tasks that the service process hands to a child process.

Tasks are imported on both sides: a module that defines one loads no kernels. What `perform` needs
of them it imports itself; the forkserver has loaded them by then.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Self

from service.formats import ReadLimits
from service.settings import Settings
from service.workers.messages import Answer
from service.workers.progress import ProgressReport
from service.workers.sandbox.limits import ResourceLimits

CPU_SLACK_S = 10
"""CPU seconds beyond the time limit, so that the wall clock ends a task first."""


FREE_DISK_FACTOR = 2
"""Tasks leave so many times MPE_MIN_FREE_DISK_BYTES free, so that the API accepts meanwhile."""


@dataclass(frozen=True, slots=True)
class TaskEnvironment:
    """Where a task runs and what it may take."""

    job_id: str
    tenant: str
    data_dir: Path
    scratch: Path
    """The only folder that a task writes to; the parent removes it."""
    threads: int
    limits: ResourceLimits
    min_free_disk_bytes: int
    """Bytes of the disk that the task leaves free."""
    requires_sandbox: bool
    """Whether the task must not run where a part of the sandbox is missing."""

    @property
    def read_limits(self) -> ReadLimits:
        """Bounds of what the task decodes."""
        return ReadLimits.within(
            self.limits.memory_bytes, min_free_disk_bytes=self.min_free_disk_bytes
        )

    @classmethod
    def create(cls, *, job_id: str, tenant: str, scratch: Path, settings: Settings) -> Self:
        """Return the environment of a task of a job."""
        cpu_s = int(settings.threads * settings.job_timeout_s) + CPU_SLACK_S
        return cls(
            job_id=job_id,
            tenant=tenant,
            data_dir=settings.data_dir,
            scratch=scratch,
            threads=settings.threads,
            limits=ResourceLimits(memory_bytes=settings.job_memory_bytes, cpu_s=cpu_s),
            min_free_disk_bytes=FREE_DISK_FACTOR * settings.min_free_disk_bytes,
            requires_sandbox=settings.require_sandbox,
        )


@dataclass(frozen=True, slots=True)
class Task(ABC):
    """Work for one child process."""

    uses_network: ClassVar[bool] = False
    """Whether the child keeps its network; a task that decodes files must not."""

    environment: TaskEnvironment

    @property
    @abstractmethod
    def readable(self) -> list[Path]:
        """Files and folders that the task reads, besides its scratch folder and libraries."""

    @abstractmethod
    def perform(self, report: ProgressReport) -> Answer:
        """Do the work in this process and return the answer; raise what prevents it."""


@dataclass(frozen=True, slots=True)
class FileTask(Task):
    """Work whose result is one file; its answer is an Exported."""

    @property
    @abstractmethod
    def output(self) -> Path:
        """The file that is written, in the scratch folder."""
