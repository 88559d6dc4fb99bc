"""Labels of workers; the announced hashes of uploads that go to the bucket directly."""

from __future__ import annotations

from alembic import op
from sqlalchemy import JSON, Column, String

revision = "9"
down_revision = "8"


def upgrade() -> None:
    """From version 8 to version 9."""
    op.add_column("worker_slots", Column("labels", JSON, nullable=False, server_default="[]"))
    op.add_column("uploads", Column("sha256", String))
