"""The truth about every job: one row each, changed only by guarded updates."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from typing import Any

from sqlalchemy import Connection, Row, Update, and_, func, insert, or_, select, update
from sqlalchemy import delete as delete_from

from service.jobs.database import open_database
from service.jobs.job import CloudInput, JobRow, Outcome
from service.jobs.tables import jobs, migrate
from service.problems import QueueFullError, WorkerLostError, problem, problem_type

MAX_LOST_ATTEMPTS = 3


class JobStore:
    """Jobs in an SQL database: SQLite beside the blobs, or PostgreSQL.

    A worker that lost its job (cancelled, timed out, lease expired) cannot overwrite it: each of
    its writes is guarded by the attempt number that it was given, and answers whether it counted.
    """

    def __init__(self, url: str, *, queue_limit: int) -> None:
        self._engine = open_database(url)
        self._writer = self._engine.execution_options(writes=True)
        self._queue_limit = queue_limit
        # one writer at a time, first come first served: SQLite's own waiting polls, and is unfair
        self._writing = threading.Lock()
        with self._write() as connection:
            migrate(connection)

    def close(self) -> None:
        """Give the connections back."""
        self._engine.dispose()

    @contextmanager
    def _write(self) -> Iterator[Connection]:
        with self._writing, self._writer.begin() as connection:
            yield connection

    def add(self, job: JobRow) -> None:
        """Accept a job; QueueFullError when as many wait as may wait."""
        with self._write() as connection:
            waiting = _count(connection, "queued")
            if waiting >= self._queue_limit:
                raise QueueFullError(
                    f"{waiting} registrations wait already, no more may; try again later",
                    headers={"Retry-After": "10"},
                    members={"queued": waiting},
                )
            connection.execute(insert(jobs).values(**asdict(job)))

    def get(self, job_id: str) -> JobRow | None:
        """The job, or None."""
        with self._engine.connect() as connection:
            row = connection.execute(select(jobs).where(jobs.c.id == job_id)).one_or_none()
        return None if row is None else _job(row)

    def page(self, *, limit: int, before: tuple[float, str] | None) -> list[JobRow]:
        """Up to `limit` jobs, newest first, older than the (created_at, id) of `before`."""
        query = select(jobs).order_by(jobs.c.created_at.desc(), jobs.c.id.desc()).limit(limit)
        if before is not None:
            created_at, job_id = before
            same_time = and_(jobs.c.created_at == created_at, jobs.c.id < job_id)
            query = query.where(or_(jobs.c.created_at < created_at, same_time))
        with self._engine.connect() as connection:
            return [_job(row) for row in connection.execute(query)]

    def count(self, status: str) -> int:
        """Number of jobs of this status."""
        with self._engine.connect() as connection:
            return _count(connection, status)

    def claim(self, *, lease_s: float) -> JobRow | None:
        """Begin an attempt at the job that waits longest; None when none waits."""
        oldest = (
            select(jobs.c.id)
            .where(jobs.c.status == "queued")
            .order_by(jobs.c.created_at, jobs.c.id)
            .limit(1)
            .with_for_update(skip_locked=True)
            .scalar_subquery()
        )
        now = time.time()
        begin = (
            update(jobs)
            .where(jobs.c.id == oldest, jobs.c.status == "queued")
            .values(
                status="running",
                attempt=jobs.c.attempt + 1,
                started_at=now,
                lease_until=now + lease_s,
            )
            .returning(jobs)
        )
        with self._write() as connection:
            row = connection.execute(begin).one_or_none()
        return None if row is None else _job(row)

    def heartbeat(self, job: JobRow, *, lease_s: float) -> bool:
        """Extend the lease; False when the attempt is no longer the job's."""
        return self._update_attempt(job, lease_until=time.time() + lease_s)

    def progress(self, job: JobRow, stage: str, fraction: float) -> bool:
        """Record how far the attempt is; False when it is no longer the job's."""
        return self._update_attempt(job, stage=stage, fraction=fraction)

    def succeed(self, job: JobRow, outcome: Outcome) -> bool:
        """Commit a result; False when the attempt is no longer the job's."""
        values = asdict(outcome)
        values["timing"] = self._timing(job, outcome.timing)
        return self._end(job, status="succeeded", **values)

    def fail(self, job: JobRow, error: dict[str, Any], timing: dict[str, float]) -> bool:
        """Commit a failure; False when the attempt is no longer the job's."""
        return self._end(job, status="failed", error=error, timing=self._timing(job, timing))

    def hand_back(self, job: JobRow) -> bool:
        """Return a job that was interrupted through no fault of its own to the queue."""
        return self._update_attempt(job, **_WAITING)

    def lose(self, job: JobRow, reason: str) -> bool:
        """An attempt ended without an answer: queue the job again, or fail it the third time."""
        lost = job.lost_attempts + 1
        if lost < MAX_LOST_ATTEMPTS:
            return self._update_attempt(job, lost_attempts=lost, **_WAITING)
        error = WorkerLostError(f"{lost} attempts ended without an answer; the last: {reason}")
        return self.fail(job, problem(problem_type(error), str(error)), {})

    def recover(self) -> int:
        """Lose every running attempt: nobody works on them after a crash. Returns how many."""
        with self._engine.connect() as connection:
            running = select(jobs).where(jobs.c.status == "running")
            orphans = [_job(row) for row in connection.execute(running)]
        for job in orphans:
            self.lose(job, "the service was stopped or killed meanwhile")
        return len(orphans)

    def cancel(self, job_id: str) -> bool:
        """End a job that waits or runs; False when it had ended or is unknown."""
        now = time.time()
        end = (
            update(jobs)
            .where(jobs.c.id == job_id, jobs.c.status.in_(("queued", "running")))
            .values(status="cancelled", finished_at=now, lease_until=None)
        )
        return self._changes_one(end)

    def remove(self, job_id: str) -> bool:
        """Forget a job that has ended; False when there is none."""
        ended = jobs.c.status.in_(("succeeded", "failed", "cancelled"))
        with self._write() as connection:
            done = connection.execute(delete_from(jobs).where(jobs.c.id == job_id, ended))
            return done.rowcount == 1

    def _timing(self, job: JobRow, stages: dict[str, float]) -> dict[str, float]:
        assert job.started_at is not None  # noqa: S101
        queued, total = job.started_at - job.created_at, time.time() - job.created_at
        return {"queued_s": queued, **stages, "total_s": total}

    def _end(self, job: JobRow, **values: Any) -> bool:
        return self._update_attempt(
            job, finished_at=time.time(), lease_until=None, stage="finished", fraction=1.0, **values
        )

    def _update_attempt(self, job: JobRow, **values: Any) -> bool:
        mine = and_(jobs.c.id == job.id, jobs.c.attempt == job.attempt, jobs.c.status == "running")
        return self._changes_one(update(jobs).where(mine).values(**values))

    def _changes_one(self, change: Update) -> bool:
        with self._write() as connection:
            return connection.execute(change).rowcount == 1


_WAITING = {"status": "queued", "lease_until": None, "stage": "queued", "fraction": 0.0}


def _count(connection: Connection, status: str) -> int:
    query = select(func.count()).select_from(jobs).where(jobs.c.status == status)
    return connection.scalar(query) or 0


def _job(row: Row[Any]) -> JobRow:
    values = dict(row._mapping)
    for cloud in ("source", "target"):
        values[cloud] = CloudInput(**values[cloud])
    return JobRow(**values)
