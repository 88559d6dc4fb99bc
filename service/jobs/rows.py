"""Rows of the jobs table: reading them, and recording each change as an event."""

from __future__ import annotations

import time
from typing import Any
from uuid import uuid4

from sqlalchemy import Connection, Row, Select, and_, func, insert, literal, select, update

from service.jobs.job import ENDED, CloudInput, JobRow
from service.jobs.tables import deliveries, events, jobs
from service.shown import shown


def job_of(row: Row[Any]) -> JobRow:
    """The job that the row holds."""
    values = dict(row._mapping)
    for cloud in ("source", "target"):
        values[cloud] = CloudInput(**values[cloud])
    return JobRow(**values)


def find_job(connection: Connection, job_id: str, tenant: str | None = None) -> JobRow | None:
    """The job, or None; of this tenant, if one is named."""
    query = select(jobs).where(jobs.c.id == job_id)
    if tenant is not None:
        query = query.where(jobs.c.tenant == tenant)
    row = connection.execute(query).one_or_none()
    return None if row is None else job_of(row)


def count_jobs(connection: Connection, status: str, tenant: str | None = None) -> int:
    """Number of jobs of this status; of this tenant, if one is named."""
    query = select(func.count()).select_from(jobs).where(jobs.c.status == status)
    if tenant is not None:
        query = query.where(jobs.c.tenant == tenant)
    return connection.scalar(query) or 0


def record_change(connection: Connection, job_id: str) -> None:
    """Append the job, as it is now, to its events; plan the call that tells of its end."""
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
    ended = and_(jobs.c.id == job_id, jobs.c.status.in_(ENDED), jobs.c.callback_url.is_not(None))
    plan_delivery(connection, select(jobs.c.id).where(ended))


def hide_signatures(connection: Connection, job_id: str) -> None:
    """Keep no more of the URLs of a job's clouds than may be shown: they are not fetched again."""
    query = select(jobs.c.source, jobs.c.target).where(jobs.c.id == job_id)
    clouds = connection.execute(query).one()._mapping
    hidden = {role: {**cloud, "url": shown(cloud["url"])} for role, cloud in clouds.items()}
    if hidden != clouds:
        connection.execute(update(jobs).where(jobs.c.id == job_id).values(**hidden))


def plan_delivery(connection: Connection, which: Select[tuple[str]]) -> str | None:
    """A call to the callback of the job that the query finds, due now; its id, if there is one."""
    job_id = connection.scalar(which)
    if job_id is None:
        return None
    delivery_id, now = str(uuid4()), time.time()
    row = {"id": delivery_id, "job_id": job_id, "status": "pending", "tries": []}
    connection.execute(insert(deliveries).values(**row, created_at=now, next_at=now))
    return delivery_id
