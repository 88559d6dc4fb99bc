"""How much a tenant has stored, in clouds, jobs and uploads."""

from __future__ import annotations

from typing import Any

from sqlalchemy import BigInteger, Column, Select, and_, cast, func, select, union

from service.database.engine import Database
from service.database.tables import clouds, jobs, uploads
from service.jobs.retention import HOLDS_BLOBS


def count_stored_bytes(database: Database, tenant: str) -> int:
    """Return the bytes kept for the tenant.

    Each blob counts once, however many jobs and clouds refer to it. An upload counts in full from
    its start.
    """
    of_tenant = and_(jobs.c.tenant == tenant, HOLDS_BLOBS)
    blobs = union(
        _select_blob(jobs.c.source).where(of_tenant),
        _select_blob(jobs.c.target).where(of_tenant),
        select(jobs.c.result_sha256, jobs.c.result_bytes).where(of_tenant),
        select(clouds.c.sha256, clouds.c.size).where(clouds.c.tenant == tenant),
    ).subquery()
    in_progress = and_(uploads.c.tenant == tenant, uploads.c.is_complete.is_(False))
    with database.read() as connection:
        stored = connection.scalar(select(func.sum(blobs.c[1])))
        arriving = connection.scalar(select(func.sum(uploads.c.length)).where(in_progress))
    return int(stored or 0) + int(arriving or 0)


def _select_blob(cloud: Column[Any]) -> Select[Any]:
    """Select hash and size from a JSON column that holds a CloudInput."""
    return select(cloud["sha256"].as_string(), cast(cloud["size"].as_string(), BigInteger))
