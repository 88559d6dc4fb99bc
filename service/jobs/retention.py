"""What the jobs still need, and what has been kept long enough."""

from __future__ import annotations

import time

from sqlalchemy import and_, delete, or_, select, update

from service.jobs.database import Database
from service.jobs.job import ENDED
from service.jobs.tables import clouds, jobs


def drop_expired(database: Database) -> None:
    """Forget the results, the jobs and the clouds whose time has come."""
    now = time.time()
    expired = and_(jobs.c.result_expires_at < now, jobs.c.result_sha256.is_not(None))
    with database.write() as connection:
        connection.execute(
            update(jobs).where(expired).values(result_sha256=None, inliers_sha256=None)
        )
        connection.execute(delete(jobs).where(jobs.c.expires_at < now))
        connection.execute(delete(clouds).where(clouds.c.expires_at < now))


def needed_blobs(database: Database) -> set[str]:
    """Hashes of the blobs that a job which waits or runs, a kept result or a cloud needs."""
    needed = or_(jobs.c.status.not_in(ENDED), jobs.c.result_sha256.is_not(None))
    columns = (
        jobs.c.source["sha256"].as_string(),
        jobs.c.target["sha256"].as_string(),
        jobs.c.result_sha256,
        jobs.c.inliers_sha256,
    )
    with database.read() as connection:
        rows = connection.execute(select(*columns).where(needed))
        used = {sha256 for row in rows for sha256 in row if sha256 is not None}
    return used | referable_blobs(database)


def referable_blobs(database: Database) -> set[str]:
    """Hashes of the blobs that a registration may refer to as clouds."""
    with database.read() as connection:
        return set(connection.scalars(select(clouds.c.sha256)))
