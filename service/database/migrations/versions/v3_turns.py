"""Turns of the tenants; interruptions of jobs, which are no fault of theirs."""

from __future__ import annotations

from alembic import op
from sqlalchemy import BigInteger, Column, Float, Integer, String

revision = "3"
down_revision = "2"


def upgrade() -> None:
    """From version 2 to version 3."""
    op.create_table(
        "turns",
        Column("tenant", String, primary_key=True),
        Column("turn", BigInteger, nullable=False),
    )
    op.add_column("jobs", Column("interruptions", Integer, nullable=False, server_default="0"))
    op.add_column("jobs", Column("paused_until", Float))
