"""The tables of the job store, and how an older data directory is brought up to date."""

from __future__ import annotations

from collections.abc import Callable

from sqlalchemy import (
    JSON,
    Column,
    Connection,
    Float,
    Index,
    Integer,
    MetaData,
    String,
    Table,
    insert,
    select,
    update,
)

metadata = MetaData()

jobs = Table(
    "jobs",
    metadata,
    Column("id", String, primary_key=True),
    Column("status", String, nullable=False),
    # times: seconds since the epoch, UTC
    Column("created_at", Float, nullable=False),
    Column("started_at", Float),
    Column("finished_at", Float),
    # the attempt number is the fencing token: a worker writes only `WHERE attempt = its own`
    Column("attempt", Integer, nullable=False),
    # attempts that ended without an answer
    Column("lost_attempts", Integer, nullable=False),
    Column("lease_until", Float),
    Column("stage", String, nullable=False),
    Column("fraction", Float, nullable=False),
    Column("source", JSON, nullable=False),
    Column("target", JSON, nullable=False),
    Column("options", JSON, nullable=False),
    Column("timing", JSON, nullable=False),
    Column("warnings", JSON, nullable=False),
    Column("error", JSON),
    Column("result_sha256", String),
    Column("inliers_sha256", String),
)
Index("jobs_by_age", jobs.c.created_at, jobs.c.id)
Index("jobs_waiting", jobs.c.status, jobs.c.created_at)

schema_version = Table("schema_version", metadata, Column("version", Integer, primary_key=True))

# Step i brings a store of version i to version i + 1. A released step is never edited.
MIGRATIONS: tuple[Callable[[Connection], None], ...] = (metadata.create_all,)


def migrate(connection: Connection) -> None:
    """Bring the store to the newest version; refuse one that a later release has written."""
    schema_version.create(connection, checkfirst=True)
    version = connection.scalar(select(schema_version.c.version))
    if version is None:
        version = 0
        connection.execute(insert(schema_version).values(version=version))
    if version > len(MIGRATIONS):
        raise RuntimeError(
            f"the job store has version {version}, this release knows {len(MIGRATIONS)}: "
            "use the release that wrote it, or a later one"
        )
    for step in MIGRATIONS[version:]:
        step(connection)
    connection.execute(update(schema_version).values(version=len(MIGRATIONS)))
