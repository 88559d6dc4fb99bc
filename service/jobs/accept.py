"""Acceptance of a job: a replay, a job whose result is known, or one for the queue."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import asdict, replace
from typing import Any, get_args

from sqlalchemy import Connection, Row, and_, insert, select

from service.database.clock import now, read_time
from service.database.tables import idempotency_keys, jobs
from service.jobs.claim_order import enter_queue
from service.jobs.events import record_change, record_end
from service.jobs.idempotency import Idempotency
from service.jobs.model import JobQueue, JobRow, Retention
from service.jobs.rows import count_jobs, find_job
from service.jobs.search import render_search_text
from service.jobs.sizes import choose_queue
from service.problems import IdempotencyMismatchError, QueueFullError, QuotaExceededError


def accept_job(
    connection: Connection,
    job: JobRow,
    idempotency: Idempotency | None,
    *,
    queue_limit: int,
    tenant_queue_limit: int | None,
    retention: Retention,
    stored: Container[str],
    large_bytes: int | None = None,
) -> JobRow:
    """Insert a job, within an exclusive transaction of the caller.

    Parameters
    ----------
    stored
        Hashes of the files of `find_result` that are there: a result whose files are missing is
        computed again. They are looked for before, as the store of the files may not answer.
    large_bytes
        As in `service.jobs.sizes.choose_queue`.

    Returns
    -------
    JobRow
        The job; already succeeded when the result of the same work is kept. Under an idempotency
        key that was used before: the job that was accepted then.

    Raises
    ------
    IdempotencyMismatchError
        The key was used for another request.
    QueueFullError
        `queue_limit` jobs are queued.
    QuotaExceededError
        `tenant_queue_limit` jobs of the tenant are queued.
    """
    if idempotency is not None:
        earlier = _find_replayed(connection, job.tenant, idempotency)
        if earlier is not None:
            return earlier
    job = replace(job, queue=choose_queue(job, large_bytes))
    job = _reuse_result(connection, job, retention, stored)
    if job.status == "queued":
        check_queue_limit(count_jobs(connection, "queued"), queue_limit)
        if tenant_queue_limit is not None:
            queued = count_jobs(connection, "queued", job.tenant)
            check_tenant_queue_limit(queued, tenant_queue_limit)
        enter_queue(connection, job.tenant, *get_args(JobQueue))
    row = {**asdict(job), "search_text": render_search_text(job)}
    connection.execute(insert(jobs), row)
    if job.status == "succeeded":
        job = record_end(connection, job)
    else:
        record_change(connection, job.id)
    if idempotency is not None:
        key = {**asdict(idempotency), "tenant": job.tenant, "job_id": job.id}
        connection.execute(insert(idempotency_keys), key)
    return job


def check_queue_limit(queued: int, limit: int) -> None:
    """Check that one more job may be queued.

    Raises
    ------
    QueueFullError
        `limit` jobs are queued.
    """
    if queued >= limit:
        raise QueueFullError(
            f"The queue is full: {queued} registrations are waiting (limit {limit}). Retry later.",
            members={"queued": queued},
        )


def check_tenant_queue_limit(queued: int, limit: int) -> None:
    """Check that one more job of a tenant may be queued.

    Raises
    ------
    QuotaExceededError
        `limit` jobs of the tenant are queued.
    """
    if queued >= limit:
        raise QuotaExceededError(
            f"Queue quota exceeded: {queued} of your registrations are waiting (limit {limit}). "
            "Retry later.",
            retry_after_s=QueueFullError.retry_after_s,
            members={"limit": "queue_limit", "used": queued, "allowed": limit},
        )


def _find_replayed(connection: Connection, tenant: str, idempotency: Idempotency) -> JobRow | None:
    is_same_key = and_(
        idempotency_keys.c.tenant == tenant, idempotency_keys.c.key == idempotency.key
    )
    earlier = connection.execute(select(idempotency_keys).where(is_same_key)).one_or_none()
    if earlier is None:
        return None
    if earlier.fingerprint != idempotency.fingerprint:
        raise IdempotencyMismatchError(
            "This Idempotency-Key was used for another request; use a new key."
        )
    return find_job(connection, jobs.c.id == earlier.job_id)


def find_result(connection: Connection, job: JobRow) -> Row[Any] | None:
    """Return the row whose result, which is kept, is that of the same work, or None.

    Only results of its own tenant count: `cached` must not tell what other tenants registered.
    """
    if not job.work_key:
        return None
    is_same_work = and_(
        jobs.c.tenant == job.tenant,
        jobs.c.work_key == job.work_key,
        jobs.c.status == "succeeded",
        jobs.c.result_expires_at > now(),
    )
    query = select(jobs).where(is_same_work).order_by(jobs.c.finished_at.desc()).limit(1)
    return connection.execute(query).one_or_none()


def _reuse_result(
    connection: Connection, job: JobRow, retention: Retention, stored: Container[str]
) -> JobRow:
    """End the job with the kept result of the same work, if there is one."""
    row = find_result(connection, job)
    if row is None or row.result_sha256 not in stored or row.inliers_sha256 not in stored:
        return job
    moment = read_time(connection)
    return replace(
        job,
        status="succeeded",
        cached=True,
        started_at=moment,
        finished_at=moment,
        stage="finished",
        fraction=1.0,
        timing={"queued_s": 0.0, "total_s": max(0.0, moment - job.created_at)},
        warnings=row.warnings,
        result_sha256=row.result_sha256,
        inliers_sha256=row.inliers_sha256,
        result_bytes=row.result_bytes,
        confidence=row.confidence,
        result_expires_at=moment + retention.result_s,
        expires_at=moment + retention.job_s,
    )
