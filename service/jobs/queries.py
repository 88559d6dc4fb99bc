"""Read access to jobs, within the limits of a tenant."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from sqlalchemy import ColumnElement, and_, func, select

from service.database.clock import now, read_time
from service.database.engine import Database
from service.database.pagination import Place, select_page
from service.database.tables import events, jobs, turns
from service.jobs.model import JOB_STATUSES, JobEvent, JobQueue, JobRow, JobStatus
from service.jobs.rows import count_jobs, find_job, job_from_row
from service.jobs.search import match_words


@dataclass(frozen=True, slots=True)
class JobFilter:
    """Which of a tenant's jobs a list shows; None does not restrict it."""

    status: JobStatus | None = None
    label: tuple[str, str] | None = None
    """Name and value that the job must be labelled with."""
    words: tuple[str, ...] = ()
    """Each must match, as in `service.jobs.search`."""
    created_after: float | None = None
    """Exclusive, in seconds since the epoch."""
    created_before: float | None = None
    """Exclusive, in seconds since the epoch."""


class JobQueries:
    """Jobs as they are; only a method that says so goes beyond one tenant."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def get(self, tenant: str, job_id: str) -> JobRow | None:
        """Return the tenant's job, or None."""
        with self._database.read() as connection:
            return find_job(connection, jobs.c.id == job_id, jobs.c.tenant == tenant)

    def get_unscoped(self, job_id: str) -> JobRow | None:
        """Return the job of whatever tenant, or None; not for what a caller asks."""
        with self._database.read() as connection:
            return find_job(connection, jobs.c.id == job_id)

    def page(
        self,
        tenant: str,
        *,
        limit: int,
        only: JobFilter | None = None,
        before: Place | None = None,
    ) -> list[JobRow]:
        """Return up to `limit` jobs, newest first, after the place where the last page ended."""
        query = select_page(jobs, before=before, limit=limit).where(jobs.c.tenant == tenant)
        query = query.where(*_conditions(only or JobFilter()))
        with self._database.read() as connection:
            return [job_from_row(row) for row in connection.execute(query)]

    def events(
        self, tenant: str, job_id: str, *, after: int, limit: int | None = None
    ) -> list[JobEvent]:
        """Return the first events of the tenant's job whose number is above `after`, in order."""
        columns = [column for column in events.c if column is not events.c.job_id]
        query = (
            select(*columns)
            .join(jobs, and_(jobs.c.id == events.c.job_id, jobs.c.tenant == tenant))
            .where(events.c.job_id == job_id, events.c.number > after)
            .order_by(events.c.number)
            .limit(limit)
        )
        with self._database.read() as connection:
            return [JobEvent(**row._mapping) for row in connection.execute(query)]

    def count(
        self, status: JobStatus, tenant: str | None = None, queue: JobQueue | None = None
    ) -> int:
        """Return the number of jobs of this status, of one tenant or of all, in a queue or all."""
        with self._database.read() as connection:
            return count_jobs(connection, status, tenant, queue)

    def count_waiting(self, queue: JobQueue) -> int:
        """Return the number of jobs of all tenants that wait in a queue.

        It looks at each tenant that has had a job there, not at each job that waits elsewhere.
        """
        is_waiting = and_(jobs.c.queue == queue, jobs.c.status == "queued")
        of_tenant = select(func.count()).where(is_waiting, jobs.c.tenant == turns.c.tenant)
        query = select(func.sum(of_tenant.scalar_subquery())).where(turns.c.queue == queue)
        with self._database.read() as connection:
            return int(connection.scalar(query) or 0)

    def count_by_status(self) -> dict[JobStatus, int]:
        """Return the number of jobs of all tenants of each status."""
        query = select(jobs.c.status, func.count()).group_by(jobs.c.status)
        with self._database.read() as connection:
            counts = {row[0]: row[1] for row in connection.execute(query)}
        return {status: counts.get(status, 0) for status in JOB_STATUSES}

    def queue_age_s(self) -> float:
        """Return the age of the oldest queued job of all tenants, 0 without any."""
        age = now() - func.min(jobs.c.created_at)
        with self._database.read() as connection:
            return max(0.0, connection.scalar(select(age).where(jobs.c.status == "queued")) or 0.0)

    def present(self) -> float:
        """Return the time of the database's clock, in seconds since the epoch."""
        with self._database.read() as connection:
            return read_time(connection)


def _conditions(only: JobFilter) -> Iterator[ColumnElement[bool]]:
    if only.status is not None:
        yield jobs.c.status == only.status
    if only.label is not None:
        name, value = only.label
        yield jobs.c.labels[name].as_string() == value
    yield from match_words(only.words)
    if only.created_after is not None:
        yield jobs.c.created_at > only.created_after
    if only.created_before is not None:
        yield jobs.c.created_at < only.created_before
