"""Supervision of one attempt: child process, progress, heartbeat, timeout, outcome."""

from __future__ import annotations

import logging
import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from service.jobs.child import Child, ChildLostError
from service.jobs.confinement import Limits
from service.jobs.job import CloudInput, JobRow, Outcome, is_terminal
from service.jobs.scratch import scratch_of
from service.jobs.standby import Standby
from service.jobs.store import JobStore
from service.jobs.task import Task
from service.jobs.work import work_key
from service.problems import DeadlineError, JobTimeoutError, ServiceError, error_problem
from service.settings import Settings
from service.sources import FetchRules
from service.storage import BlobStore

LEASE_S = 30.0
HEARTBEAT_S = LEASE_S / 3
LOOK_S = 0.5
"""Another service on the same database may cancel the job: so often is it looked at."""

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Worker:
    """Runs attempts, each in a child process; belongs to one thread, which waits meanwhile."""

    store: JobStore
    blobs: BlobStore
    settings: Settings
    announce: Callable[[str], None]
    """Called with the job's id after each change of its row."""
    started: Callable[[JobRow, Child], None]
    """Called with the job and its child, so that a cancel can kill it."""
    ended: Callable[[JobRow], None]
    """Called with the job's row when an attempt has ended the job."""
    standby: Standby = field(default_factory=Standby)

    def work(self, job: JobRow) -> None:
        """One attempt at a claimed job, to its end in the store."""
        scratch = scratch_of(self.settings.data_dir, job)
        scratch.mkdir(parents=True)
        try:
            self._attempt(job, self._task(job, scratch))
        except ChildLostError as lost:
            if self.store.lose(job, str(lost)):
                log.warning("attempt %d was lost: %s", job.attempt, lost)
        finally:
            shutil.rmtree(scratch, ignore_errors=True)
            self.announce(job.id)
        self._tell_of_end(job)

    def _tell_of_end(self, job: JobRow) -> None:
        row = self.store.get(job.id)
        if row is not None and row.attempt == job.attempt and is_terminal(row.status):
            log.info("registration %s", row.status, extra={"attempt": row.attempt})
            self.ended(row)

    def _attempt(self, job: JobRow, task: Task) -> None:
        child = self.standby.take()
        answered = False
        try:
            self.started(job, child)
            child.hand(task)
            answered = self._follow(job, child)
        finally:
            child.kill()
            if answered:
                self.standby.let_end(child)
            else:
                child.close()

    def _follow(self, job: JobRow, child: Child) -> bool:
        """Record what the child says; True when it has given its answer, False when it must end."""
        bound = self._bound(job)
        beat = time.time() + HEARTBEAT_S
        mine = True
        while mine:
            now = time.time()
            if now >= bound.at:
                self.store.fail(job, error_problem(bound.error), {})
                return False
            message = child.receive(min(bound.at - now, LOOK_S))
            if now >= beat:
                mine = self.store.heartbeat(job, lease_s=LEASE_S)
                beat = now + HEARTBEAT_S
            elif message is None:
                mine = self.store.holds(job)
            if message is None:
                continue
            answered = self._conclude(job, message)
            if not answered:
                mine = self.store.progress(job, message["stage"], message["fraction"])
            self.announce(job.id)
            if answered:
                return True
            self.standby.begin()  # for the next job, while this one runs
        return False

    def _conclude(self, job: JobRow, message: dict[str, Any]) -> bool:
        if "outcome" in message:
            outcome = _outcome(message["outcome"])
            self._keep(outcome.result_sha256, outcome.inliers_sha256)
            self.store.succeed(job, outcome, work_key(outcome.source, outcome.target, job.options))
        elif "error" in message:
            self.store.fail(job, message["error"], message["timing"])
        else:
            return False
        return True

    def _keep(self, *blobs: str) -> None:
        """Spare what the child has stored until the row refers to it."""
        try:
            for sha256 in blobs:
                self.blobs.touch(sha256)
        except FileNotFoundError as error:
            raise ChildLostError("its result was removed before it was recorded") from error

    def _bound(self, job: JobRow) -> _Bound:
        """When the attempt must end, and why then."""
        allowed = self.settings.job_timeout_s
        timeout = JobTimeoutError(f"The attempt was ended after the allowed {allowed:g} s.")
        bounds = [_Bound(time.time() + allowed, timeout)]
        if job.deadline_at is not None:
            late = DeadlineError("The attempt was ended when the deadline passed.")
            bounds.append(_Bound(job.deadline_at, late))
        return min(bounds, key=lambda bound: bound.at)

    def _task(self, job: JobRow, scratch: Path) -> Task:
        settings = self.settings
        cpu_s = int(settings.threads * settings.job_timeout_s) + 10
        return Task(
            job_id=job.id,
            tenant=job.tenant,
            source=job.source,
            target=job.target,
            options=job.options,
            data_dir=settings.data_dir,
            scratch=scratch,
            threads=settings.threads,
            limits=Limits(memory_bytes=settings.job_memory_bytes, cpu_s=cpu_s),
            fetch_rules=FetchRules.of(settings),
        )


@dataclass(frozen=True, slots=True)
class _Bound:
    at: float
    """Seconds since the epoch."""
    error: ServiceError


def _outcome(message: dict[str, Any]) -> Outcome:
    source, target = CloudInput(**message.pop("source")), CloudInput(**message.pop("target"))
    return Outcome(source=source, target=target, **message)
