"""What is recorded together with a change of a job, in the same transaction."""

from __future__ import annotations

from dataclasses import asdict, replace
from urllib.parse import urlsplit
from uuid import uuid4

from sqlalchemy import (
    Connection,
    Insert,
    String,
    bindparam,
    func,
    insert,
    select,
    update,
)

from service.clouds.inputs import CLOUD_ROLES
from service.database.clock import now
from service.database.tables import deliveries, events, jobs
from service.jobs.model import JobRow
from service.outbound.urls import redact_url


def record_change(connection: Connection, job_id: str) -> None:
    """Append the present state of the job to its events."""
    connection.execute(_INSERT_EVENT, {"event_job_id": job_id})


def record_end(connection: Connection, job: JobRow) -> JobRow:
    """Append the end of the job to its events, plan its callback and redact its URLs.

    The clouds are not fetched again, so nothing needs the secrets that their URLs may hold.

    Returns
    -------
    JobRow
        As it is in the table now.
    """
    record_change(connection, job.id)
    plan_delivery(connection, job)
    return _redact_urls(connection, job)


def plan_delivery(connection: Connection, job: JobRow) -> None:
    """Plan a call to the callback of the job, if it has one, due now."""
    if job.callback_url is None:
        return
    row = {"id": str(uuid4()), "job_id": job.id, "status": "pending", "tries": []}
    place = {"tenant": job.tenant, "host": urlsplit(job.callback_url).netloc}
    connection.execute(insert(deliveries).values(**row, **place, created_at=now(), next_at=now()))


def _insert_event() -> Insert:
    job_id = bindparam("event_job_id", type_=String)
    last = select(func.coalesce(func.max(events.c.number), 0)).where(events.c.job_id == job_id)
    state = select(
        jobs.c.id,
        last.scalar_subquery() + 1,
        now(),
        jobs.c.status,
        jobs.c.stage,
        jobs.c.fraction,
    ).where(jobs.c.id == job_id)
    return insert(events).from_select(list(events.c), state)


_INSERT_EVENT = _insert_event()  # built once: building takes longer than executing


def _redact_urls(connection: Connection, job: JobRow) -> JobRow:
    clouds = {role: getattr(job, role) for role in CLOUD_ROLES}
    redacted = {role: replace(cloud, url=redact_url(cloud.url)) for role, cloud in clouds.items()}
    if redacted == clouds:
        return job
    values = {role: asdict(cloud) for role, cloud in redacted.items()}
    connection.execute(update(jobs).where(jobs.c.id == job.id).values(**values))
    return replace(job, **redacted)
