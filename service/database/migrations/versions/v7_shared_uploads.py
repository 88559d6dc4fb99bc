"""Pieces of uploads that are blobs, so that any service goes on with them."""

from __future__ import annotations

from alembic import op
from sqlalchemy import JSON, BigInteger, Column

revision = "7"
down_revision = "6"


def upgrade() -> None:
    """From version 6 to version 7."""
    received = Column("received", BigInteger, nullable=False, server_default="0")
    op.add_column("uploads", received)
    op.add_column("uploads", Column("pieces", JSON, nullable=False, server_default="[]"))
