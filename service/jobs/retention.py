"""What the jobs still need, and what has been kept long enough."""

from __future__ import annotations

import time
from typing import Any

from sqlalchemy import (
    BigInteger,
    Column,
    ColumnElement,
    and_,
    cast,
    delete,
    func,
    or_,
    select,
    union,
    update,
)

from service.database.engine import Database
from service.database.tables import clouds, jobs, uploads
from service.jobs.model import ENDED

_INPUTS = (jobs.c.source, jobs.c.target)


def drop_expired(database: Database) -> None:
    """Forget the results, the jobs and the clouds whose time has come."""
    now = time.time()
    expired = and_(jobs.c.result_expires_at < now, jobs.c.result_sha256.is_not(None))
    with database.write(alone=True) as connection:
        connection.execute(
            update(jobs).where(expired).values(result_sha256=None, inliers_sha256=None)
        )
        connection.execute(delete(jobs).where(jobs.c.expires_at < now))
        connection.execute(delete(clouds).where(clouds.c.expires_at < now))


# while a job waits or runs, and while its result is kept
KEEPS_FILES = or_(jobs.c.status.not_in(ENDED), jobs.c.result_sha256.is_not(None))


def needed_blobs(database: Database) -> set[str]:
    """Hashes of the blobs that a job which waits or runs, a kept result or a cloud needs."""
    given = (_text(role, "sha256") for role in _INPUTS)
    columns = (*given, jobs.c.result_sha256, jobs.c.inliers_sha256)
    with database.read() as connection:
        rows = connection.execute(select(*columns).where(KEEPS_FILES))
        used = {sha256 for row in rows for sha256 in row if sha256 is not None}
    return used | {sha256 for _, sha256 in referable_blobs(database)}


def referable_blobs(database: Database) -> set[tuple[str, str]]:
    """The blobs that registrations may refer to as clouds: (tenant, hash)."""
    with database.read() as connection:
        rows = connection.execute(select(clouds.c.tenant, clouds.c.sha256))
        return {(row.tenant, row.sha256) for row in rows}


def stored_bytes(database: Database, tenant: str) -> int:
    """Bytes of all that is kept for the tenant: each file once, and the uploads under way."""
    mine = and_(jobs.c.tenant == tenant, KEEPS_FILES)
    files = union(
        *(select(_text(role, "sha256"), _number(role, "size")).where(mine) for role in _INPUTS),
        select(jobs.c.result_sha256, jobs.c.result_bytes).where(mine),
        select(clouds.c.sha256, clouds.c.size).where(clouds.c.tenant == tenant),
    ).subquery()
    arriving = and_(uploads.c.tenant == tenant, uploads.c.is_complete.is_(False))
    with database.read() as connection:
        kept = connection.scalar(select(func.sum(files.c[1])))
        coming = connection.scalar(select(func.sum(uploads.c.length)).where(arriving))
    return int(kept or 0) + int(coming or 0)


def _text(role: Column[Any], name: str) -> ColumnElement[str]:
    text: ColumnElement[str] = role[name].as_string()
    return text


def _number(role: Column[Any], name: str) -> ColumnElement[int]:
    return cast(_text(role, name), BigInteger)
