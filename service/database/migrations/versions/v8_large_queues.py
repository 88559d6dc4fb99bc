"""Indexes for 100,000 jobs; a turn for each tenant with jobs, so that none is looked for."""

from __future__ import annotations

from alembic import op
from sqlalchemy import text

revision = "8"
down_revision = "7"


def upgrade() -> None:
    """From version 7 to version 8."""
    highest_first = text("priority DESC")
    op.create_index(
        "jobs_by_turn",
        "jobs",
        ["tenant", "queue", "status", highest_first, "created_at", "id"],
    )
    op.create_index("jobs_by_status", "jobs", ["tenant", "status", "created_at", "id"])
    op.create_index("jobs_by_age_of_all", "jobs", ["status", "created_at"])
    op.create_index("jobs_by_deadline", "jobs", ["status", "deadline_at"])
    op.drop_index("jobs_waiting", "jobs")
    op.execute(
        "INSERT INTO turns (tenant, queue, turn) SELECT DISTINCT jobs.tenant, jobs.queue, 0"
        " FROM jobs LEFT JOIN turns ON turns.tenant = jobs.tenant AND turns.queue = jobs.queue"
        " WHERE turns.tenant IS NULL"
    )
