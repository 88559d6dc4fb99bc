"""Rows of the jobs table: reading them, and recording each change as an event."""

from __future__ import annotations

import time
from typing import Any
from uuid import uuid4

from sqlalchemy import (
    Connection,
    Float,
    Insert,
    Row,
    Select,
    String,
    and_,
    bindparam,
    func,
    insert,
    select,
    update,
)

from service.clouds.inputs import CloudInput
from service.database.tables import deliveries, events, jobs
from service.jobs.model import JobRow
from service.outbound.redact import shown


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
    """Append the job, as it is now, to its events."""
    connection.execute(_EVENT, {"of_job": job_id, "moment": time.time()})


def _event() -> Insert:
    job = bindparam("of_job", type_=String)
    last = select(func.coalesce(func.max(events.c.number), 0)).where(events.c.job_id == job)
    now = select(
        jobs.c.id,
        last.scalar_subquery() + 1,
        bindparam("moment", type_=Float),
        jobs.c.status,
        jobs.c.stage,
        jobs.c.fraction,
    ).where(jobs.c.id == job)
    return insert(events).from_select(list(events.c), now)


_EVENT = _event()  # built once: that takes longer than to execute it


def record_end(connection: Connection, job_id: str) -> None:
    """Append the end to the job's events, plan the call that tells of it, and keep no more of the
    URLs of its clouds than may be shown: they are not fetched again."""
    record_change(connection, job_id)
    called = and_(jobs.c.id == job_id, jobs.c.callback_url.is_not(None))
    plan_delivery(connection, select(jobs.c.id).where(called))
    _hide_signatures(connection, job_id)


def _hide_signatures(connection: Connection, job_id: str) -> None:
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
