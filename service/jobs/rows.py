"""Rows of the jobs table as `JobRow`, within a transaction of the caller."""

from __future__ import annotations

from typing import Any

from sqlalchemy import ColumnElement, Connection, Row, func, select

from service.clouds.inputs import CLOUD_ROLES, CloudInput
from service.database.tables import jobs
from service.jobs.model import JobQueue, JobRow, JobStatus


def job_from_row(row: Row[Any]) -> JobRow:
    """Convert a row with all columns of the jobs table."""
    values = dict(row._mapping)
    del values["search_text"]
    for role in CLOUD_ROLES:
        values[role] = CloudInput(**values[role])
    return JobRow(**values)


def find_job(connection: Connection, *conditions: ColumnElement[bool]) -> JobRow | None:
    """Return the only job that meets the conditions, or None."""
    row = connection.execute(select(jobs).where(*conditions)).one_or_none()
    return None if row is None else job_from_row(row)


def count_jobs(
    connection: Connection,
    status: JobStatus,
    tenant: str | None = None,
    queue: JobQueue | None = None,
) -> int:
    """Return the number of jobs of this status, of one tenant or of all, in one queue or in all."""
    query = select(func.count()).select_from(jobs).where(jobs.c.status == status)
    if tenant is not None:
        query = query.where(jobs.c.tenant == tenant)
    if queue is not None:
        query = query.where(jobs.c.queue == queue)
    return connection.scalar(query) or 0
