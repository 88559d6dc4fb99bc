"""Two queues of jobs: those whose clouds have to be fetched, and those that workers can run."""

from __future__ import annotations

from alembic import op
from sqlalchemy import JSON, BigInteger, Column, String, column, or_, table

revision = "4"
down_revision = "3"


def upgrade() -> None:
    """From version 3 to version 4."""
    op.add_column("jobs", Column("queue", String, nullable=False, server_default="register"))
    jobs = table("jobs", column("queue"), column("source", JSON), column("target", JSON))
    is_fetched = [
        cloud["sha256"].as_string().is_not(None) for cloud in (jobs.c.source, jobs.c.target)
    ]
    op.execute(jobs.update().where(or_(*(~known for known in is_fetched))).values(queue="fetch"))
    op.drop_table("turns")  # the turns begin anew
    op.create_table(
        "turns",
        Column("tenant", String, primary_key=True),
        Column("queue", String, primary_key=True),
        Column("turn", BigInteger, nullable=False),
    )
