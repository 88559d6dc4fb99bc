"""Rows of the jobs table: reading them, and recording each change as an event."""

from __future__ import annotations

import time
from typing import Any

from sqlalchemy import Connection, Row, func, insert, literal, select

from service.jobs.job import CloudInput, JobRow
from service.jobs.tables import events, jobs


def job_of(row: Row[Any]) -> JobRow:
    """The job that the row holds."""
    values = dict(row._mapping)
    for cloud in ("source", "target"):
        values[cloud] = CloudInput(**values[cloud])
    return JobRow(**values)


def find_job(connection: Connection, job_id: str) -> JobRow | None:
    """The job, or None."""
    row = connection.execute(select(jobs).where(jobs.c.id == job_id)).one_or_none()
    return None if row is None else job_of(row)


def count_jobs(connection: Connection, status: str) -> int:
    """Number of jobs of this status."""
    query = select(func.count()).select_from(jobs).where(jobs.c.status == status)
    return connection.scalar(query) or 0


def record_event(connection: Connection, job_id: str) -> None:
    """Append the job, as it is now, to its events."""
    last = select(func.coalesce(func.max(events.c.number), 0)).where(events.c.job_id == job_id)
    now = select(
        jobs.c.id,
        last.scalar_subquery() + 1,
        literal(time.time()),
        jobs.c.status,
        jobs.c.stage,
        jobs.c.fraction,
    ).where(jobs.c.id == job_id)
    connection.execute(insert(events).from_select(list(events.c), now))
