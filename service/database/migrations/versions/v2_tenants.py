"""API keys; every job, cloud, upload and idempotency key belongs to a tenant."""

from __future__ import annotations

from alembic import op
from sqlalchemy import BigInteger, Boolean, Column, Float, ForeignKey, Integer, String, text

revision = "2"
down_revision = "1"

TENANT = "default"
"""Whose everything was until now."""


def upgrade() -> None:
    """From version 1 to version 2."""
    _create_keys()
    op.add_column("jobs", _tenant())
    op.add_column("jobs", Column("result_bytes", BigInteger))
    op.drop_index("jobs_by_age", "jobs")
    op.create_index("jobs_by_age", "jobs", ["tenant", "created_at", "id"])
    op.add_column("uploads", _tenant())
    op.add_column("uploads", Column("format", String))
    _rebuild_clouds()
    _rebuild_idempotency_keys()


def _tenant() -> Column[str]:
    return Column("tenant", String, nullable=False, server_default=TENANT)


def _create_keys() -> None:
    op.create_table(
        "api_keys",
        Column("id", String, primary_key=True),
        Column("tenant", String, nullable=False),
        Column("name", String, nullable=False),
        Column("secret_sha256", String, nullable=False),
        Column("created_at", Float, nullable=False),
        Column("revoked_at", Float),
        Column("requests_per_s", Float),
        Column("queue_limit", Integer),
        Column("stored_bytes", BigInteger),
    )


def _rebuild_clouds() -> None:
    """Two tenants may give their clouds the same id."""
    op.create_table(
        "clouds_by_tenant",
        Column("tenant", String, primary_key=True),
        Column("id", String, primary_key=True),
        Column("sha256", String, nullable=False),
        Column("size", BigInteger, nullable=False),
        Column("format", String, nullable=False),
        Column("declared", Boolean, nullable=False),
        Column("created_at", Float, nullable=False),
        Column("expires_at", Float, nullable=False),
    )
    columns = "id, sha256, size, format, created_at, expires_at"
    _move("clouds", "clouds_by_tenant", columns, declared="false")
    op.create_index("clouds_by_age", "clouds", ["tenant", "created_at", "id"])


def _rebuild_idempotency_keys() -> None:
    op.create_table(
        "idempotency_keys_by_tenant",
        Column("tenant", String, primary_key=True),
        Column("key", String, primary_key=True),
        Column("fingerprint", String, nullable=False),
        Column("job_id", String, ForeignKey("jobs.id", ondelete="CASCADE"), nullable=False),
    )
    _move("idempotency_keys", "idempotency_keys_by_tenant", "key, fingerprint, job_id")
    op.create_index("idempotency_by_job", "idempotency_keys", ["job_id"])


def _move(old: str, new: str, columns: str, **values: str) -> None:
    """Put the rows into the new table, which takes the place of the old one."""
    added = {"tenant": f"'{TENANT}'", **values}
    names, given = ", ".join(added), ", ".join(added.values())
    op.execute(
        text(f"INSERT INTO {new} ({names}, {columns}) SELECT {given}, {columns} FROM {old}")  # noqa: S608
    )
    op.drop_table(old)
    op.rename_table(new, old)
