"""Jobs with their events, deliveries and idempotency keys; clouds; uploads."""

from __future__ import annotations

from alembic import op
from sqlalchemy import JSON, BigInteger, Boolean, Column, Float, ForeignKey, Integer, String

revision = "1"
down_revision = None


def upgrade() -> None:
    """From nothing to version 1."""
    _create_jobs()
    _create_what_belongs_to_jobs()
    _create_clouds()


def _create_jobs() -> None:
    op.create_table(
        "jobs",
        Column("id", String, primary_key=True),
        Column("status", String, nullable=False),
        Column("created_at", Float, nullable=False),
        Column("started_at", Float),
        Column("finished_at", Float),
        Column("attempt", Integer, nullable=False),
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
        Column("confidence", Float),
        Column("labels", JSON, nullable=False),
        Column("priority", Integer, nullable=False),
        Column("deadline_at", Float),
        Column("work_key", String),
        Column("cached", Boolean, nullable=False),
        Column("callback_url", String),
        Column("result_expires_at", Float),
        Column("expires_at", Float),
    )
    op.create_index("jobs_by_age", "jobs", ["created_at", "id"])
    op.create_index("jobs_waiting", "jobs", ["status", "priority", "created_at"])
    op.create_index("jobs_by_work", "jobs", ["work_key"])


def _create_what_belongs_to_jobs() -> None:
    op.create_table(
        "events",
        Column("job_id", String, ForeignKey("jobs.id", ondelete="CASCADE"), primary_key=True),
        Column("number", Integer, primary_key=True),
        Column("at", Float, nullable=False),
        Column("status", String, nullable=False),
        Column("stage", String, nullable=False),
        Column("fraction", Float, nullable=False),
    )
    op.create_table(
        "deliveries",
        Column("id", String, primary_key=True),
        Column("job_id", String, ForeignKey("jobs.id", ondelete="CASCADE"), nullable=False),
        Column("status", String, nullable=False),
        Column("created_at", Float, nullable=False),
        Column("next_at", Float),
        Column("tries", JSON, nullable=False),
    )
    op.create_index("deliveries_due", "deliveries", ["status", "next_at"])
    op.create_index("deliveries_by_job", "deliveries", ["job_id"])
    op.create_table(
        "idempotency_keys",
        Column("key", String, primary_key=True),
        Column("fingerprint", String, nullable=False),
        Column("job_id", String, ForeignKey("jobs.id", ondelete="CASCADE"), nullable=False),
    )
    op.create_index("idempotency_by_job", "idempotency_keys", ["job_id"])


def _create_clouds() -> None:
    op.create_table(
        "clouds",
        Column("id", String, primary_key=True),
        Column("sha256", String, nullable=False),
        Column("size", BigInteger, nullable=False),
        Column("format", String, nullable=False),
        Column("created_at", Float, nullable=False),
        Column("expires_at", Float, nullable=False),
    )
    op.create_index("clouds_by_age", "clouds", ["created_at", "id"])
    op.create_table(
        "uploads",
        Column("id", String, primary_key=True),
        Column("length", BigInteger, nullable=False),
        Column("is_complete", Boolean, nullable=False),
        Column("expires_at", Float, nullable=False),
    )
