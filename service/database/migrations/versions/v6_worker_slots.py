"""How many registrations each service can run at once."""

from __future__ import annotations

from alembic import op
from sqlalchemy import Column, Float, Integer, String

revision = "6"
down_revision = "5"


def upgrade() -> None:
    """From version 5 to version 6."""
    op.create_table(
        "worker_slots",
        Column("service", String, primary_key=True),
        Column("number", Integer, nullable=False),
        Column("lease_until", Float, nullable=False),
    )
