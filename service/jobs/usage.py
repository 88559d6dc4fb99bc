"""How much a tenant has stored, in clouds, jobs and uploads: files and rows."""

from __future__ import annotations

from typing import Any

from sqlalchemy import (
    BigInteger,
    Column,
    Connection,
    Select,
    Text,
    and_,
    cast,
    func,
    literal,
    select,
    union,
)

from service.database.engine import Database
from service.database.tables import clouds, deliveries, jobs, uploads
from service.jobs.retention import HOLDS_BLOBS

ROW_BYTES = 4096
"""Bytes that a row of a job, a cloud, an upload or a callback counts for, with what belongs to it:
its events, its key, a block of the disk for its file."""
_TEXTS = (
    *(jobs.c.source, jobs.c.target, jobs.c.options, jobs.c.labels),
    *(jobs.c.warnings, jobs.c.callback_url, jobs.c.search_text),
)
"""Columns whose length is the caller's choice; each counts."""


def count_stored_bytes(database: Database, tenant: str) -> int:
    """Return the bytes kept for the tenant, in files and rows.

    Each blob counts once, however many jobs and clouds refer to it. An upload counts in full from
    its start.
    """
    with database.read() as connection:
        return _count_file_bytes(connection, tenant) + _count_row_bytes(connection, tenant)


def _count_file_bytes(connection: Connection, tenant: str) -> int:
    of_tenant = and_(jobs.c.tenant == tenant, HOLDS_BLOBS)
    blobs = union(
        _select_blob(jobs.c.source).where(of_tenant),
        _select_blob(jobs.c.target).where(of_tenant),
        select(jobs.c.result_sha256, jobs.c.result_bytes).where(of_tenant),
        select(clouds.c.sha256, clouds.c.size).where(clouds.c.tenant == tenant),
    ).subquery()
    in_progress = and_(uploads.c.tenant == tenant, uploads.c.is_complete.is_(False))
    stored = connection.scalar(select(func.sum(blobs.c[1])))
    arriving = connection.scalar(select(func.sum(uploads.c.length)).where(in_progress))
    return int(stored or 0) + int(arriving or 0)


def _count_row_bytes(connection: Connection, tenant: str) -> int:
    lengths = (func.coalesce(func.length(cast(column, Text)), 0) for column in _TEXTS)
    length = sum(lengths, start=literal(0))
    texts = connection.scalar(select(func.sum(length)).where(jobs.c.tenant == tenant))
    rows = sum(
        connection.scalar(select(func.count()).where(table.c.tenant == tenant)) or 0
        for table in (jobs, clouds, uploads, deliveries)
    )
    return int(texts or 0) + ROW_BYTES * rows


def _select_blob(cloud: Column[Any]) -> Select[Any]:
    """Select hash and size from a JSON column that holds a CloudInput."""
    return select(cloud["sha256"].as_string(), cast(cloud["size"].as_string(), BigInteger))
