"""Accepting a job: said twice, known already, or one too many?"""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass, replace

from sqlalchemy import Connection, and_, insert, select

from service.database.tables import idempotency_keys, jobs
from service.jobs.model import JobRow, Retention
from service.jobs.rows import count_jobs, find_job, record_change, record_end
from service.problems import IdempotencyMismatchError, QueueFullError, QuotaExceededError


@dataclass(frozen=True, slots=True)
class Idempotency:
    """The caller's key, and the hash of what was asked for under it."""

    key: str
    fingerprint: str


def accept(
    connection: Connection,
    job: JobRow,
    idempotency: Idempotency | None,
    *,
    queue_limit: int,
    tenant_queue_limit: int | None,
    retention: Retention,
) -> JobRow:
    """Insert the job, or find the one that it repeats; see JobStore.add."""
    if idempotency is not None:
        former = _replayed(connection, job.tenant, idempotency)
        if former is not None:
            return former
    job = _with_known_result(connection, job, retention)
    if job.status == "queued":
        check_queue_limit(count_jobs(connection, "queued"), queue_limit)
        if tenant_queue_limit is not None:
            check_tenant_queue_limit(
                count_jobs(connection, "queued", job.tenant), tenant_queue_limit
            )
    connection.execute(insert(jobs), asdict(job))
    record = record_end if job.status == "succeeded" else record_change
    record(connection, job.id)
    if idempotency is not None:
        row = {**asdict(idempotency), "tenant": job.tenant, "job_id": job.id}
        connection.execute(insert(idempotency_keys).values(**row))
    return job


def check_queue_limit(waiting: int, limit: int) -> None:
    """QueueFullError when as many jobs wait as may wait."""
    if waiting >= limit:
        raise QueueFullError(
            f"The queue is full: {waiting} registrations are waiting (limit {limit}). Retry later.",
            members={"queued": waiting},
        )


def check_tenant_queue_limit(waiting: int, limit: int) -> None:
    """QuotaExceededError when as many jobs of a tenant wait as may wait."""
    if waiting >= limit:
        raise QuotaExceededError(
            f"Queue quota exceeded: {waiting} of your registrations are waiting (limit {limit}). "
            "Retry later.",
            retry_after_s=QueueFullError.retry_after_s,
            members={"limit": "queue_limit", "used": waiting, "allowed": limit},
        )


def _replayed(connection: Connection, tenant: str, idempotency: Idempotency) -> JobRow | None:
    known = and_(idempotency_keys.c.tenant == tenant, idempotency_keys.c.key == idempotency.key)
    former = connection.execute(select(idempotency_keys).where(known)).one_or_none()
    if former is None:
        return None
    if former.fingerprint != idempotency.fingerprint:
        raise IdempotencyMismatchError(
            "Another request was made under this Idempotency-Key; use a new key."
        )
    return find_job(connection, former.job_id)


def _with_known_result(connection: Connection, job: JobRow, retention: Retention) -> JobRow:
    """The job, ended with the result of the same work if that is still kept.

    Of its own tenant's work: `cached` must not tell that somebody else had the same clouds.
    """
    now = time.time()
    known = and_(
        jobs.c.tenant == job.tenant,
        jobs.c.work_key == job.work_key,
        jobs.c.status == "succeeded",
        jobs.c.result_expires_at > now,
    )
    query = select(jobs).where(known).order_by(jobs.c.finished_at.desc()).limit(1)
    row = connection.execute(query).one_or_none() if job.work_key else None
    if row is None:
        return job
    return replace(
        job,
        status="succeeded",
        cached=True,
        started_at=now,
        finished_at=now,
        stage="finished",
        fraction=1.0,
        timing={"queued_s": 0.0, "total_s": now - job.created_at},
        warnings=row.warnings,
        result_sha256=row.result_sha256,
        inliers_sha256=row.inliers_sha256,
        result_bytes=row.result_bytes,
        confidence=row.confidence,
        result_expires_at=now + retention.result_s,
        expires_at=now + retention.job_s,
    )
