"""Exports: files written for a caller, in a bounded number of child processes at once."""

from __future__ import annotations

import secrets
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path

from mpe_core.machine import count_oom_kills
from service.jobs.model import JobRow
from service.jobs.transitions import MAX_LOST_ATTEMPTS
from service.problems import (
    TYPE_PREFIX,
    ConnectionClosedError,
    ExpiredError,
    JobMemoryError,
    JobTimeoutError,
    NotReadyError,
    OverloadedError,
    ProblemType,
    ServiceError,
    WorkerLostError,
)
from service.settings import Settings
from service.storage.blobs import BlobStore
from service.storage.disk_space import DiskSpace
from service.storage.plain_file import is_plain_file
from service.storage.scratch import scratch_folder
from service.telemetry.json_logs import job_context
from service.workers.child import (
    OUT_OF_MEMORY,
    Child,
    ChildLostError,
    ChildMemoryError,
    NoProcessError,
)
from service.workers.messages import Answer, Exported, Failed, Problem
from service.workers.task import FileTask, TaskEnvironment

MAX_RUNNING = 2
"""Exports at once; each takes the memory of two decoded clouds."""
MAX_WAITING = 8
"""Further exports that wait in a thread; those of the API wait before, in a `TenantGate`."""
DISK_INTERVAL_S = 0.25
"""Interval of the looks at the disk while a file grows, in seconds."""


is_abandoned: ContextVar[threading.Event | None] = ContextVar("is_abandoned", default=None)
"""Event in the context of an export that is set when its caller is gone: then it ends."""


class ExportError(ServiceError):
    """The child process could not write the file, for the reason of its problem document."""

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem.detail)
        slug = problem.type.removeprefix(TYPE_PREFIX)
        self.problem = ProblemType(problem.status, slug, problem.title)


@dataclass(frozen=True, slots=True)
class ExportedFile:
    """A written file."""

    path: Path
    warnings: tuple[str, ...]
    """What the format could not hold."""


class Exporter:
    """Writes files of registrations, each in a child process."""

    def __init__(self, settings: Settings, blobs: BlobStore) -> None:
        self._settings = settings
        self._blobs = blobs
        self._disk = DiskSpace(settings.data_dir, settings.min_free_disk_bytes)
        self._changed = threading.Condition()
        self._waiting = 0
        self._running = 0
        self._children: set[Child] = set()
        self._is_stopping = False

    @contextmanager
    def export(
        self, job: JobRow, make_task: Callable[[TaskEnvironment], FileTask]
    ) -> Iterator[ExportedFile]:
        """Write a file of a registration.

        Parameters
        ----------
        job : JobRow
            The registration; its clouds are stored.
        make_task : callable
            Returns the task that writes the file, for the environment that it runs in.

        Yields
        ------
        ExportedFile
            The file, which is removed when the context ends.

        Raises
        ------
        JobTimeoutError
            It took longer than MPE_JOB_TIMEOUT_S.
        OverloadedError
            Too many exports are waiting, or the file leaves too little of the disk.
        NotReadyError
            The service is stopping, or can start no process.
        ConnectionClosedError
            The caller is gone.
        JobMemoryError
            The machine ran out of memory.
        ExportError, WorkerLostError
            The child process failed or was lost.
        ExpiredError
            A cloud is missing in the store.
        """
        name = f"{job.id}-export-{secrets.token_hex(4)}"
        with scratch_folder(self._settings.data_dir, name) as scratch:
            environment = TaskEnvironment.create(
                job_id=job.id, tenant=job.tenant, scratch=scratch, settings=self._settings
            )
            task = make_task(environment)
            with job_context(job.id), self._turn(), self._inputs(job):
                warnings = self._perform(task)
            yield ExportedFile(task.output, tuple(warnings))

    def stop(self) -> None:
        """Kill the running exports and refuse those that wait."""
        with self._changed:
            self._is_stopping = True
            self._changed.notify_all()
            for child in self._children:
                child.kill()

    @contextmanager
    def _turn(self) -> Iterator[None]:
        """Wait until fewer than MAX_RUNNING exports run, and count this one."""
        with self._changed:
            if self._waiting >= MAX_WAITING:
                raise OverloadedError("Too many exports are waiting; retry later.")
            self._waiting += 1
            self._changed.wait_for(lambda: self._is_stopping or self._running < MAX_RUNNING)
            self._waiting -= 1
            self._running += 1
        try:
            yield
        finally:
            with self._changed:
                self._running -= 1
                self._changed.notify_all()

    @contextmanager
    def _inputs(self, job: JobRow) -> Iterator[None]:
        """Keep the files of both clouds in the data directory."""
        with ExitStack() as held:
            for cloud in (job.source, job.target):
                assert cloud.sha256 is not None  # noqa: S101
                try:
                    held.enter_context(self._blobs.hold(cloud.sha256))
                except FileNotFoundError:
                    raise ExpiredError("A cloud has expired; register the clouds again.") from None
            yield

    def _perform(self, task: FileTask) -> list[str]:
        """Let a child write the file, and another one where it was lost; return the warnings.

        As many are tried as for a registration: one may be killed for the sake of another, or with
        the forkserver.
        """
        for tries_left in reversed(range(MAX_LOST_ATTEMPTS)):
            oom_kills = count_oom_kills()
            try:
                with self._child() as child:
                    answer = _await_answer(child, task, self._settings.job_timeout_s, self._disk)
                break
            except ChildLostError as lost:
                error = self._explain(lost, count_oom_kills() - oom_kills)
                if not tries_left or self._is_stopping or isinstance(error, JobMemoryError):
                    raise error from lost
        if isinstance(answer, Failed):
            raise ExportError(answer.problem)
        if not is_plain_file(task.output):
            raise WorkerLostError("The file could not be written: it is missing.")
        return answer.warnings if isinstance(answer, Exported) else []

    def _explain(self, lost: ChildLostError, oom_kills: int) -> ServiceError:
        """Return what the loss of a child is to the caller; the kernel has killed so many."""
        if self._is_stopping:
            return NotReadyError("The service is stopping; retry later.")
        if lost.is_killed and oom_kills:
            return JobMemoryError(OUT_OF_MEMORY)
        if isinstance(lost, ChildMemoryError):
            return JobMemoryError.beyond(self._settings.job_memory_bytes)
        if isinstance(lost, NoProcessError):
            return NotReadyError(f"The file was not written: {lost}. Retry later.")
        return WorkerLostError(f"The file could not be written: {lost}.")

    @contextmanager
    def _child(self) -> Iterator[Child]:
        """Start a child that `stop` can kill; it has ended when the context ends."""
        child = Child()
        with self._changed:
            self._children.add(child)
            if self._is_stopping:
                child.kill()
        try:
            yield child
        finally:
            with self._changed:
                self._children.discard(child)
            child.kill()
            child.close()


def _await_answer(child: Child, task: FileTask, timeout_s: float, disk: DiskSpace) -> Answer:
    if not child.wait_until_ready():
        raise ChildLostError("its process did not get ready")
    child.send_task(task)
    deadline = time.monotonic() + timeout_s
    abandoned = is_abandoned.get()
    while (left_s := deadline - time.monotonic()) > 0:
        message = child.receive(min(left_s, DISK_INTERVAL_S))
        is_unexplained = isinstance(message, Failed) and message.is_unexplained
        if disk.is_short and (message is None or is_unexplained):
            raise OverloadedError("Too little disk is left for the file; retry later.")
        if isinstance(message, Exported | Failed):
            return message
        if message is not None:
            raise ChildLostError(f"it answered {message.kind!r} to another task")
        if abandoned is not None and abandoned.is_set():
            raise ConnectionClosedError("The connection was closed during the export.")
    raise JobTimeoutError(f"The export was ended after the allowed {timeout_s:g} s.")
