"""Which rows have expired, and which blobs the remaining ones need."""

from __future__ import annotations

from sqlalchemy import (
    ColumnElement,
    Delete,
    Table,
    Update,
    and_,
    delete,
    or_,
    select,
    tuple_,
    update,
)

from service.database.clock import now
from service.database.engine import Database, ReadableDatabase
from service.database.tables import clouds, jobs, uploads
from service.jobs.model import TERMINAL_STATUSES

MAX_ROWS = 200
"""Rows that expire in one transaction, with all that belongs to them (docs/tuning.md)."""
HOLDS_BLOBS = or_(jobs.c.status.not_in(TERMINAL_STATUSES), jobs.c.result_sha256.is_not(None))
"""Condition: the job is queued or running, or its result is kept."""


def drop_expired(database: Database) -> None:
    """Drop the results, jobs and clouds that have expired; their blobs are collected later.

    Few rows a transaction: after a long pause thousands expire at once, and all who write wait.
    """
    has_old_result = and_(jobs.c.result_expires_at < now(), jobs.c.result_sha256.is_not(None))
    no_result = {"result_sha256": None, "inliers_sha256": None}
    is_old_job, is_old_cloud = jobs.c.expires_at < now(), clouds.c.expires_at < now()
    _change_all(database, jobs, has_old_result, update(jobs).values(**no_result))
    _change_all(database, jobs, is_old_job, delete(jobs))
    _change_all(database, clouds, is_old_cloud, delete(clouds))


def _change_all(
    database: Database, table: Table, condition: ColumnElement[bool], change: Update | Delete
) -> None:
    """Change all rows that meet the condition; they are sought while others may write."""
    key = tuple_(*table.primary_key)
    query = select(*table.primary_key).where(condition).limit(MAX_ROWS)
    while True:
        with database.read() as connection:
            found = [tuple(row) for row in connection.execute(query)]
        if not found:
            return
        with database.write(exclusive=True) as connection:
            connection.execute(change.where(key.in_(found), condition))


def find_needed_blobs(database: ReadableDatabase) -> set[str]:
    """Return the hashes of all blobs that a job, a stored cloud or an unfinished upload needs."""
    inputs = (cloud["sha256"].as_string() for cloud in (jobs.c.source, jobs.c.target))
    query = select(*inputs, jobs.c.result_sha256, jobs.c.inliers_sha256).where(HOLDS_BLOBS)
    with database.read() as connection:
        rows = connection.execute(query)
        needed = {sha256 for row in rows for sha256 in row if sha256 is not None}
        unfinished = connection.scalars(select(uploads.c.pieces).where(~uploads.c.is_complete))
        needed |= {piece["sha256"] for pieces in unfinished for piece in pieces}
    return needed | {sha256 for _, sha256 in find_cloud_blobs(database)}


def find_cloud_blobs(database: ReadableDatabase) -> set[tuple[str, str]]:
    """Return tenant and blob hash of every stored cloud."""
    with database.read() as connection:
        rows = connection.execute(select(clouds.c.tenant, clouds.c.sha256))
        return {(row.tenant, row.sha256) for row in rows}
