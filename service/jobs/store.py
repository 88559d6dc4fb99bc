"""The truth about every job: one row each, changed only by guarded updates."""

from __future__ import annotations

import time
from dataclasses import asdict
from typing import Any

from sqlalchemy import ColumnElement, Connection, and_, delete, func, select, update
from sqlalchemy.sql.dml import ReturningUpdate

from service.database.engine import Database
from service.database.pagination import Place
from service.database.tables import events, jobs
from service.jobs.accept import Idempotency, accept
from service.jobs.listing import Filter, newest_first
from service.jobs.model import ENDED, JobEvent, JobRow, Outcome, Retention
from service.jobs.rows import count_jobs, find_job, job_of, record_change, record_end
from service.problems import DeadlineError, WorkerLostError, error_document

MAX_LOST_ATTEMPTS = 3


class JobStore:
    """Jobs in the database.

    A worker that lost its job (cancelled, timed out, lease expired) cannot overwrite it: each of
    its writes is guarded by the attempt number that it was given, and answers whether it counted.
    """

    def __init__(self, database: Database, *, queue_limit: int, retention: Retention) -> None:
        self._database = database
        self._queue_limit = queue_limit
        self._retention = retention

    def add(
        self,
        job: JobRow,
        idempotency: Idempotency | None = None,
        *,
        tenant_queue_limit: int | None = None,
    ) -> JobRow:
        """Accept a job and return it, already ended when the result of the same work is kept.

        The job that came first under the same idempotency key is returned instead.

        Raises
        ------
        IdempotencyMismatchError
            Something else was asked for under the same key.
        QueueFullError
            As many jobs wait as may wait.
        QuotaExceededError
            As many jobs of the tenant wait as may.
        """
        with self._database.write(alone=True) as connection:
            return accept(
                connection,
                job,
                idempotency,
                queue_limit=self._queue_limit,
                tenant_queue_limit=tenant_queue_limit,
                retention=self._retention,
            )

    def get(self, job_id: str) -> JobRow | None:
        """The job, or None."""
        with self._database.read() as connection:
            return find_job(connection, job_id)

    def find(self, tenant: str, job_id: str) -> JobRow | None:
        """The tenant's job, or None."""
        with self._database.read() as connection:
            return find_job(connection, job_id, tenant)

    def page(self, *, limit: int, only: Filter, before: Place | None = None) -> list[JobRow]:
        """Up to `limit` jobs, newest first, from the place where the page before ended."""
        with self._database.read() as connection:
            rows = connection.execute(newest_first(only, before=before, limit=limit))
            return [job_of(row) for row in rows]

    def events(self, job_id: str, *, after: int) -> list[JobEvent]:
        """The changes of a job whose number is above `after`, in order."""
        query = (
            select(events)
            .where(events.c.job_id == job_id, events.c.number > after)
            .order_by(events.c.number)
        )
        with self._database.read() as connection:
            rows = [dict(row._mapping) for row in connection.execute(query)]
        return [JobEvent(**{k: v for k, v in row.items() if k != "job_id"}) for row in rows]

    def count(self, status: str, tenant: str | None = None) -> int:
        """Number of jobs of this status; of this tenant, if one is named."""
        with self._database.read() as connection:
            return count_jobs(connection, status, tenant)

    def waiting_since(self) -> float | None:
        """When the oldest waiting job was accepted; None when none waits."""
        query = select(func.min(jobs.c.created_at)).where(jobs.c.status == "queued")
        with self._database.read() as connection:
            oldest: float | None = connection.scalar(query)
        return oldest

    def claim(self, *, lease_s: float) -> JobRow | None:
        """Begin an attempt at the next job, by priority, then age; None when none waits."""
        now = time.time()
        times = {"started_at": now, "lease_until": now + lease_s}
        with self._database.write() as connection:
            row = connection.execute(_CLAIM, times).one_or_none()
            if row is not None:
                record_change(connection, row.id)
        return None if row is None else job_of(row)

    def heartbeat(self, job: JobRow, *, lease_s: float) -> bool:
        """Extend the lease; False when the attempt is no longer the job's."""
        extend = update(jobs).where(_mine(job)).values(lease_until=time.time() + lease_s)
        with self._database.write() as connection:
            return connection.execute(extend).rowcount == 1

    def holds(self, job: JobRow) -> bool:
        """Whether the attempt is still the job's."""
        with self._database.read() as connection:
            return connection.scalar(select(jobs.c.id).where(_mine(job))) is not None

    def progress(self, job: JobRow, stage: str, fraction: float) -> bool:
        """Record how far the attempt is; False when it is no longer the job's."""
        with self._database.write(durable=False) as connection:
            return _changed(connection, _mine(job), job.id, stage=stage, fraction=fraction)

    def fetched(self, job: JobRow) -> bool:
        """Record that its clouds are here; False when the attempt is no longer the job's."""
        values = {"source": asdict(job.source), "target": asdict(job.target), "timing": job.timing}
        return self._change(_mine(job), job.id, **values)

    def succeed(self, job: JobRow, outcome: Outcome, work_key: str | None) -> bool:
        """Commit a result; False when the attempt is no longer the job's."""
        values = asdict(outcome) | {"work_key": work_key}
        values["timing"] = _timing(job, outcome.timing)
        return self._end(_mine(job), job.id, status="succeeded", **values)

    def fail(self, job: JobRow, error: dict[str, Any], timing: dict[str, float]) -> bool:
        """Commit a failure; False when the attempt is no longer the job's."""
        timing = _timing(job, timing)
        return self._end(_mine(job), job.id, status="failed", error=error, timing=timing)

    def hand_back(self, job: JobRow) -> bool:
        """Return a job that was interrupted through no fault of its own to the queue."""
        return self._change(_mine(job), job.id, **_WAITING)

    def lose(self, job: JobRow, reason: str) -> bool:
        """An attempt ended without an answer: queue the job again, or fail it the third time."""
        lost = job.lost_attempts + 1
        if lost < MAX_LOST_ATTEMPTS:
            return self._change(_mine(job), job.id, lost_attempts=lost, **_WAITING)
        error = WorkerLostError(f"{lost} attempts ended without an answer; the last: {reason}")
        return self.fail(job, error_document(error), {})

    def recover(self) -> int:
        """Lose what a former process ran when it was killed; returns how many jobs that were.

        In a database with other users all that can be told is whose lease has ended.
        """
        lease_before = time.time() if self._database.is_shared else None
        return self.lose_all("the service was killed meanwhile", lease_before=lease_before)

    def lose_all(self, reason: str, *, lease_before: float | None = None) -> int:
        """Lose the running attempts (whose lease ended before); returns how many there were."""
        query = select(jobs).where(jobs.c.status == "running")
        if lease_before is not None:
            query = query.where(jobs.c.lease_until < lease_before)
        with self._database.read() as connection:
            orphans = [job_of(row) for row in connection.execute(query)]
        return sum(self.lose(job, reason) for job in orphans)

    def running(self) -> set[tuple[str, int]]:
        """Id and attempt number of each running job."""
        query = select(jobs.c.id, jobs.c.attempt).where(jobs.c.status == "running")
        with self._database.read() as connection:
            return {(row.id, row.attempt) for row in connection.execute(query)}

    def miss_deadlines(self) -> list[str]:
        """Fail the waiting jobs whose deadline has passed; returns their ids."""
        waiting = and_(jobs.c.status == "queued", jobs.c.deadline_at < time.time())
        with self._database.read() as connection:
            late = list(connection.scalars(select(jobs.c.id).where(waiting)))
        error = error_document(DeadlineError("The deadline passed before a worker was free."))
        return [
            job_id
            for job_id in late
            if self._end(and_(waiting, jobs.c.id == job_id), job_id, status="failed", error=error)
        ]

    def cancel(self, job_id: str) -> bool:
        """End a job that waits or runs; False when it had ended or is unknown."""
        active = and_(jobs.c.id == job_id, jobs.c.status.in_(("queued", "running")))
        return self._end(active, job_id, status="cancelled")

    def remove(self, job_id: str) -> bool:
        """Forget a job that has ended; False when there is none."""
        ended = and_(jobs.c.id == job_id, jobs.c.status.in_(ENDED))
        with self._database.write() as connection:
            return connection.execute(delete(jobs).where(ended)).rowcount == 1

    def _end(self, which: ColumnElement[bool], job_id: str, **values: Any) -> bool:
        now = time.time()
        with self._database.write() as connection:
            ended = _updated(
                connection,
                which,
                finished_at=now,
                lease_until=None,
                stage="finished",
                fraction=1.0,
                result_expires_at=now + self._retention.result_s,
                expires_at=now + self._retention.job_s,
                **values,
            )
            if ended:
                record_end(connection, job_id)
        return ended

    def _change(self, which: ColumnElement[bool], job_id: str, **values: Any) -> bool:
        with self._database.write() as connection:
            return _changed(connection, which, job_id, **values)


def _changed(
    connection: Connection, which: ColumnElement[bool], job_id: str, **values: Any
) -> bool:
    changed = _updated(connection, which, **values)
    if changed:
        record_change(connection, job_id)
    return changed


def _updated(connection: Connection, which: ColumnElement[bool], **values: Any) -> bool:
    return connection.execute(update(jobs).where(which), values).rowcount == 1


def _claim() -> ReturningUpdate[Any]:
    first = (
        select(jobs.c.id)
        .where(jobs.c.status == "queued")
        .order_by(jobs.c.priority.desc(), jobs.c.created_at, jobs.c.id)
        .limit(1)
        .with_for_update(skip_locked=True)
        .scalar_subquery()
    )
    begin = update(jobs).where(jobs.c.id == first, jobs.c.status == "queued")
    return begin.values(status="running", attempt=jobs.c.attempt + 1).returning(jobs)


_CLAIM = _claim()  # built once: that takes as long as to execute it
_WAITING = {"status": "queued", "lease_until": None, "stage": "queued", "fraction": 0.0}


def _mine(job: JobRow) -> ColumnElement[bool]:
    return and_(jobs.c.id == job.id, jobs.c.attempt == job.attempt, jobs.c.status == "running")


def _timing(job: JobRow, stages: dict[str, float]) -> dict[str, float]:
    assert job.started_at is not None  # noqa: S101
    queued, total = job.started_at - job.created_at, time.time() - job.created_at
    return {"queued_s": queued, **stages, "total_s": total}
