"""Supervision of one attempt: child process, progress, heartbeat, timeout, outcome."""

from __future__ import annotations

import contextlib
import logging
import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from service.clouds.inputs import CloudInput
from service.jobs.fingerprint import hash_work
from service.jobs.model import JobRow, Outcome
from service.jobs.transitions import JobTransitions
from service.outbound import FetchRules
from service.problems import (
    DeadlineError,
    JobTimeoutError,
    NotReadyError,
    ServiceError,
    error_document,
)
from service.settings import Settings
from service.storage.blobs import BlobStore
from service.storage.scratch import scratch_of
from service.workers.child import Child, ChildLostError
from service.workers.fetch_inputs import is_needed
from service.workers.sandbox.limits import Limits
from service.workers.spare import SpareChild
from service.workers.task import FetchTask, Task

LEASE_S = 30.0
HEARTBEAT_S = LEASE_S / 3
LOOK_S = 0.5
"""Another service on the same database may cancel the job: so often is it looked at."""

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class AttemptSupervisor:
    """Runs attempts, each in a child process; belongs to one thread, which waits meanwhile."""

    transitions: JobTransitions
    blobs: BlobStore
    settings: Settings
    started: Callable[[JobRow, Child], None]
    """Called with the job and its child, so that a cancel can kill it."""
    standby: SpareChild = field(default_factory=SpareChild)

    def work(self, job: JobRow) -> None:
        """One attempt at a claimed job, to its end in the store."""
        scratch = scratch_of(self.settings.data_dir, job.id, job.attempt)
        scratch.mkdir(parents=True)
        try:
            self._attempt(job, scratch)
        except ChildLostError as lost:
            if self.transitions.record_lost_attempt(job, str(lost)):
                log.warning("attempt %d was lost: %s", job.attempt, lost)
        finally:
            shutil.rmtree(scratch, ignore_errors=True)

    def _attempt(self, job: JobRow, scratch: Path) -> None:
        bound = self._bound(job)
        here: JobRow | None = job
        if is_needed(job.source) or is_needed(job.target):
            fetched = self._perform(job, self._fetch_task(job, scratch), bound)
            here = None if fetched is None else self._record_fetched(job, fetched)
        if here is not None:
            answer = self._perform(here, self._task(here, scratch), bound)
            if answer is not None:
                self._conclude(here, answer)

    def _perform(self, job: JobRow, task: FetchTask | Task, bound: _Bound) -> dict[str, Any] | None:
        """What a child answers to the task; None when it had to end before."""
        child = self.standby.take()
        answer = None
        try:
            self.started(job, child)
            child.hand(task)
            answer = self._follow(job, child, bound)
        finally:
            child.kill()
            if answer is None:
                child.close()
            else:
                self.standby.let_end(child)
        return answer

    def _follow(self, job: JobRow, child: Child, bound: _Bound) -> dict[str, Any] | None:
        """Record how far the child is, until it answers; None when it must end."""
        beat = time.time() + HEARTBEAT_S
        mine = True
        while mine:
            now = time.time()
            if now >= bound.at:
                self.transitions.fail(job, error_document(bound.error), {})
                return None
            message = child.receive(min(bound.at - now, LOOK_S))
            if message is not None and "stage" not in message:
                return message
            with contextlib.suppress(NotReadyError):  # the lease lasts while the store is away
                if now >= beat:
                    mine = self.transitions.extend_lease(job, lease_s=LEASE_S)
                    beat = now + HEARTBEAT_S
                mine = mine and self._is_mine(job, message)
            if message is not None:
                self.standby.begin()  # for the next task, while this one runs
        return None

    def _is_mine(self, job: JobRow, message: dict[str, Any] | None) -> bool:
        """Record how far the child is, if it said so; False when the job has been taken away."""
        if message is None:
            return self.transitions.is_current(job)
        return self.transitions.record_progress(job, message["stage"], message["fraction"])

    def _record_fetched(self, job: JobRow, answer: dict[str, Any]) -> JobRow | None:
        """The job with its clouds here; None when it is not to be gone on with."""
        if "error" in answer:
            _insist(lambda: self.transitions.fail(job, answer["error"], answer["timing"]))
            return None
        source, target = _clouds(answer["fetched"])
        self._keep(source.sha256, target.sha256)
        here = replace(job, source=source, target=target, timing=answer["timing"])
        return here if _insist(lambda: self.transitions.record_inputs(here)) else None

    def _conclude(self, job: JobRow, answer: dict[str, Any]) -> None:
        if "error" in answer:
            timing = job.timing | answer["timing"]
            _insist(lambda: self.transitions.fail(job, answer["error"], timing))
        else:
            outcome = _outcome(answer["outcome"], job.timing)
            self._keep(outcome.result_sha256, outcome.inliers_sha256)
            key = hash_work(outcome.source, outcome.target, job.options)
            _insist(lambda: self.transitions.succeed(job, outcome, key))

    def _keep(self, *blobs: str | None) -> None:
        """Spare what the child has stored until the row refers to it."""
        try:
            for sha256 in filter(None, blobs):
                self.blobs.touch(sha256)
        except FileNotFoundError as error:
            raise ChildLostError("what it stored was removed before it was recorded") from error

    def _bound(self, job: JobRow) -> _Bound:
        """When the attempt must end, and why then."""
        allowed = self.settings.job_timeout_s
        timeout = JobTimeoutError(f"The attempt was ended after the allowed {allowed:g} s.")
        bounds = [_Bound(time.time() + allowed, timeout)]
        if job.deadline_at is not None:
            late = DeadlineError("The attempt was ended when the deadline passed.")
            bounds.append(_Bound(job.deadline_at, late))
        return min(bounds, key=lambda bound: bound.at)

    def _limits(self) -> Limits:
        cpu_s = int(self.settings.threads * self.settings.job_timeout_s) + 10
        return Limits(memory_bytes=self.settings.job_memory_bytes, cpu_s=cpu_s)

    def _fetch_task(self, job: JobRow, scratch: Path) -> FetchTask:
        return FetchTask(
            job_id=job.id,
            tenant=job.tenant,
            source=job.source,
            target=job.target,
            data_dir=self.settings.data_dir,
            scratch=scratch,
            limits=self._limits(),
            rules=FetchRules.of(self.settings),
        )

    def _task(self, job: JobRow, scratch: Path) -> Task:
        settings = self.settings
        return Task(
            job_id=job.id,
            tenant=job.tenant,
            source=job.source,
            target=job.target,
            options=job.options,
            data_dir=settings.data_dir,
            scratch=scratch,
            threads=settings.threads,
            limits=self._limits(),
        )


def _insist(record: Callable[[], bool]) -> bool:
    """What the store answers, asked again while it is away, as long as the lease may last."""
    until = time.monotonic() + LEASE_S
    while time.monotonic() < until:
        with contextlib.suppress(NotReadyError):
            return record()
        time.sleep(LOOK_S)
    return record()


@dataclass(frozen=True, slots=True)
class _Bound:
    at: float
    """Seconds since the epoch."""
    error: ServiceError


def _clouds(message: dict[str, Any]) -> tuple[CloudInput, CloudInput]:
    return CloudInput(**message["source"]), CloudInput(**message["target"])


def _outcome(message: dict[str, Any], timing: dict[str, float]) -> Outcome:
    source, target = _clouds(message)
    said = {"source": source, "target": target, "timing": timing | message["timing"]}
    return Outcome(**message | said)
