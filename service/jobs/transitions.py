"""Every change of a job: the transitions of the state machine in `service.jobs.model`."""

from __future__ import annotations

import logging
from collections.abc import Callable, Container, Sequence
from dataclasses import asdict, replace
from typing import Any, Literal

from sqlalchemy import ColumnElement, Connection, and_, delete, literal, select, update

from service.database.clock import now, read_time
from service.database.engine import Database
from service.database.tables import jobs
from service.jobs.accept import accept_job, find_result
from service.jobs.announcements import Announcement
from service.jobs.claim_order import (
    MAX_PAUSE_S,
    NO_LIMIT,
    claim_next,
    enter_queue,
    find_next_tenant,
)
from service.jobs.events import record_change, record_end
from service.jobs.idempotency import Idempotency
from service.jobs.model import TERMINAL_STATUSES, JobQueue, JobRow, Outcome, Retention
from service.jobs.notifier import JobListener
from service.jobs.rows import job_from_row
from service.jobs.sizes import LARGE, choose_queue
from service.jobs.worker_slots import count_slots
from service.problems import DeadlineError, WorkerLostError, error_document

MAX_LOST_ATTEMPTS = 3
"""A job fails with this many attempts whose child ended without an answer: it kills its workers."""
MAX_INTERRUPTIONS = 20
"""A job fails with this many interrupted attempts: services seem to die of it."""
FREE_INTERRUPTIONS = 3
"""Interruptions after which a job is queued again without a pause."""

log = logging.getLogger(__name__)


class JobTransitions:
    """Changes jobs by guarded updates, and tells the listeners of each change.

    A worker that lost its job (cancelled, timed out, lease expired) cannot overwrite it: each of
    its writes is guarded by the attempt number of the job that it claimed, and returns whether it
    counted.
    """

    def __init__(
        self,
        database: Database,
        *,
        queue_limit: int,
        retention: Retention,
        is_stored: Callable[[str], bool],
        large_bytes: int | None = None,
        listeners: Sequence[JobListener] = (),
    ) -> None:
        self._database = database
        self._queue_limit = queue_limit
        self._retention = retention
        self._is_stored = is_stored
        self._large_bytes = large_bytes
        self._listeners = listeners

    def add(
        self,
        job: JobRow,
        idempotency: Idempotency | None = None,
        *,
        tenant_queue_limit: int | None = None,
    ) -> JobRow:
        """Accept a job; see `service.jobs.accept.accept_job`."""
        stored = self._find_stored(job)
        with self._database.write(exclusive=True) as connection:
            accepted = accept_job(
                connection,
                job,
                idempotency,
                queue_limit=self._queue_limit,
                tenant_queue_limit=tenant_queue_limit,
                retention=self._retention,
                stored=stored,
                large_bytes=self._large_bytes,
            )
            if accepted.status == "queued":
                self._announce(connection, "queued", accepted)
            return accepted

    def _find_stored(self, job: JobRow) -> set[str]:
        """Return the hashes of the files of a kept result of the same work that are there."""
        with self._database.read(single=True) as connection:
            row = find_result(connection, job)
        hashes = () if row is None else (row.result_sha256, row.inliers_sha256)
        return {sha256 for sha256 in hashes if self._is_stored(sha256)}

    def is_claimable(self, queue: JobQueue, tenant_limit: int = NO_LIMIT) -> bool:
        """Return whether `claim` would find a job now."""
        with self._database.read(single=True) as connection:
            return find_next_tenant(connection, queue, tenant_limit) is not None

    def claim(
        self, queue: JobQueue = "register", tenant_limit: int = NO_LIMIT, *, lease_s: float
    ) -> JobRow | None:
        """Begin an attempt at the next job of a queue, in the order of `service.jobs.claim_order`.

        Parameters
        ----------
        tenant_limit : int
            Jobs of the queue that a tenant may have running, the next one included.
        lease_s : float
            Seconds until another service may take the job, unless the lease is extended.

        Returns
        -------
        JobRow or None
            None when no job can be claimed.
        """
        with self._database.write(exclusive=True) as connection:
            row = claim_next(connection, queue, tenant_limit, lease_s=lease_s)
            if row is not None:
                record_change(connection, row.id)
                self._announce(connection, "changed", job_from_row(row))
        if row is None:
            return None
        self._notify(lambda listener: listener.changed(row.id))
        return job_from_row(row)

    def extend_lease(self, job: JobRow, *, lease_s: float) -> bool:
        """Let the lease end `lease_s` from now; return False when the attempt is not current."""
        lease = update(jobs).where(_is_current_attempt(job))
        with self._database.write(single=True) as connection:
            result = connection.execute(lease.values(lease_until=now() + lease_s))
            return result.rowcount == 1

    def is_current(self, job: JobRow) -> bool:
        """Return whether the job still runs, in the attempt that was claimed as `job`."""
        query = select(jobs.c.id).where(_is_current_attempt(job))
        with self._database.read(single=True) as connection:
            return connection.scalar(query) is not None

    def record_progress(self, job: JobRow, stage: str, fraction: float) -> bool:
        """Record how far the attempt is; return False when it is not current."""
        values = {"stage": stage, "fraction": fraction}
        return self._change(job, values, durable=False)

    def record_fetched(self, job: JobRow) -> bool:
        """Queue a job whose clouds are stored for the workers; return False if it is not current.

        The worker goes on with the attempt of the fetch.
        """
        values = {
            "source": asdict(job.source),
            "target": asdict(job.target),
            "timing": job.timing,
            "attempt": job.attempt - 1,
            "queue": choose_queue(job, self._large_bytes),
            **_QUEUED,
        }
        return self._change(job, values)

    def retry_on_larger(self, job: JobRow) -> bool:
        """Queue a job that ran out of memory for a worker with the label LARGE, once.

        Returns False when it has run on one already, when none is there, or when the attempt is
        not current.
        """
        if job.queue == "large":
            return False
        with self._database.read(single=True) as connection:
            if not count_slots(connection, LARGE):
                return False
        return self._change(job, {"queue": "large", **_QUEUED})

    def succeed(self, job: JobRow, outcome: Outcome, work_key: str | None) -> bool:
        """Commit a result; return False when the attempt is not current."""
        values = asdict(outcome) | {"work_key": work_key}
        values["timing"] = self._with_totals(job, outcome.timing)
        return self._end(_is_current_attempt(job), job.id, status="succeeded", **values)

    def fail(self, job: JobRow, error: dict[str, Any], timing: dict[str, float]) -> bool:
        """Commit a failure; return False when the attempt is not current."""
        values = {"error": error, "timing": self._with_totals(job, timing)}
        return self._end(_is_current_attempt(job), job.id, status="failed", **values)

    def requeue(self, job: JobRow) -> bool:
        """Return an attempt that was interrupted on purpose to the queue; it is not lost."""
        return self._change(job, _QUEUED)

    def record_lost_attempt(self, job: JobRow, reason: str) -> bool:
        """Return a job whose attempt ended without an answer to the queue, or fail it.

        Returns False when the attempt is not current.
        """
        lost = job.lost_attempts + 1
        if lost < MAX_LOST_ATTEMPTS:
            values = {"lost_attempts": lost, **_QUEUED}
            return self._change(job, values)
        error = WorkerLostError(f"{lost} attempts ended without an answer; the last: {reason}")
        return self.fail(job, error_document(error), {})

    def interrupt(
        self, job: JobRow, reason: str, final_error: dict[str, Any] | None = None
    ) -> bool:
        """Return a job whose attempt ended through no fault of its own to the queue.

        It waits there for a pause that doubles with each interruption; the last one that is allowed
        fails the job, with `final_error` if there is one. Returns False when the attempt is not
        current.
        """
        number = job.interruptions + 1
        if number < MAX_INTERRUPTIONS:
            pause_s = _pause_after(number)
            values = {"interruptions": number, "paused_until": now() + pause_s, **_QUEUED}
            return self._change(job, values)
        error = WorkerLostError(f"{number} attempts were interrupted; the last: {reason}")
        return self.fail(job, final_error or error_document(error), {})

    def requeue_orphans(self) -> int:
        """Interrupt the attempts that a killed service left running; return their number."""
        cutoff = literal(self._database.orphan_cutoff())
        return self._interrupt_before(cutoff, "the service was killed meanwhile")

    def expire_leases(self, held: Container[str] = ()) -> int:
        """Interrupt the attempts whose lease has ended; return their number.

        Parameters
        ----------
        held
            Ids of jobs that this process supervises. It may have been suspended beyond their
            leases; they go on.
        """
        return self._interrupt_before(now(), "its lease ended", held)

    def fail_overdue(self) -> int:
        """Fail the queued jobs whose deadline has passed; return their number."""
        is_overdue = and_(jobs.c.status == "queued", jobs.c.deadline_at < now())
        with self._database.read(single=True) as connection:
            overdue = list(connection.scalars(select(jobs.c.id).where(is_overdue)))
        error = error_document(DeadlineError("The deadline passed before a worker was free."))
        return sum(
            self._end(and_(is_overdue, jobs.c.id == job_id), job_id, status="failed", error=error)
            for job_id in overdue
        )

    def cancel(self, job_id: str) -> bool:
        """End a queued or running job; return False when it has ended or is unknown."""
        is_active = and_(jobs.c.id == job_id, jobs.c.status.not_in(TERMINAL_STATUSES))
        return self._end(is_active, job_id, status="cancelled")

    def remove(self, job_id: str) -> bool:
        """Delete a job that has ended; return False when there is none."""
        has_ended = and_(jobs.c.id == job_id, jobs.c.status.in_(TERMINAL_STATUSES))
        with self._database.write() as connection:
            return connection.execute(delete(jobs).where(has_ended)).rowcount == 1

    def _interrupt_before(
        self, cutoff: ColumnElement[float], reason: str, held: Container[str] = ()
    ) -> int:
        query = select(jobs).where(jobs.c.status == "running", jobs.c.lease_until < cutoff)
        with self._database.read(single=True) as connection:
            ended = [job_from_row(row) for row in connection.execute(query)]
        return sum(self.interrupt(job, reason) for job in ended if job.id not in held)

    def _with_totals(self, job: JobRow, stages: dict[str, float]) -> dict[str, float]:
        assert job.started_at is not None  # noqa: S101
        with self._database.read(single=True) as connection:
            total_s = read_time(connection) - job.created_at
        queued_s = job.started_at - job.created_at
        if job.queue != "fetch":
            queued_s -= job.timing.get("fetch_s", 0.0)
        # the clock may have been set back
        return {"queued_s": max(0.0, queued_s), **stages, "total_s": max(0.0, total_s)}

    def _change(self, job: JobRow, values: dict[str, Any], *, durable: bool = True) -> bool:
        """Update a job in its attempt; return False when that is not current."""
        change: Literal["queued", "changed"] = "queued" if "status" in values else "changed"
        with self._database.write(durable=durable) as connection:
            is_changed = _update(connection, _is_current_attempt(job), values)
            if is_changed:
                if "queue" in values:  # a job of an earlier release has no turn there
                    enter_queue(connection, job.tenant, values["queue"])
                record_change(connection, job.id)
                self._announce(
                    connection, change, replace(job, queue=values.get("queue", job.queue))
                )
        if is_changed:
            self._notify(lambda listener: listener.changed(job.id))
        return is_changed

    def _end(self, guard: ColumnElement[bool], job_id: str, **values: Any) -> bool:
        """End the job that meets the guard; return False when none does."""
        ending = {
            "finished_at": now(),
            "lease_until": None,
            "stage": "finished",
            "fraction": 1.0,
            "result_expires_at": now() + self._retention.result_s,
            "expires_at": now() + self._retention.job_s,
        }
        with self._database.write() as connection:
            change = update(jobs).where(guard).values(**ending | values).returning(jobs)
            row = connection.execute(change).one_or_none()
            if row is None:
                return False
            job = record_end(connection, job_from_row(row))
            self._announce(connection, "ended", job)
        self._notify(lambda listener: listener.ended(job))
        return True

    def _announce(
        self, connection: Connection, change: Literal["queued", "changed", "ended"], job: JobRow
    ) -> None:
        """Tell the other processes on the database, once the transaction is committed."""
        message = Announcement(change, job.queue, job.id).encode()
        self._database.announce(connection, message)

    def _notify(self, call: Callable[[JobListener], None]) -> None:
        """Call every listener; one that fails is logged, since the change is committed."""
        for listener in self._listeners:
            try:
                call(listener)
            except Exception:
                log.exception("a listener failed on the change of a job")


def _update(connection: Connection, guard: ColumnElement[bool], values: dict[str, Any]) -> bool:
    return connection.execute(update(jobs).where(guard).values(**values)).rowcount == 1


def _pause_after(interruptions: int) -> float:
    """Return the seconds that a job waits after so many interruptions."""
    if interruptions <= FREE_INTERRUPTIONS:
        return 0.0
    return min(MAX_PAUSE_S, 2.0 ** (interruptions - FREE_INTERRUPTIONS))


_QUEUED = {"status": "queued", "lease_until": None, "stage": "queued", "fraction": 0.0}


def _is_current_attempt(job: JobRow) -> ColumnElement[bool]:
    return and_(
        jobs.c.id == job.id,
        jobs.c.queue == job.queue,
        jobs.c.attempt == job.attempt,
        jobs.c.status == "running",
    )
