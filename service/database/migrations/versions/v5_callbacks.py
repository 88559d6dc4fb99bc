"""Tenant and host of each callback, so that they are sent in turns."""

from __future__ import annotations

from urllib.parse import urlsplit

from alembic import op
from sqlalchemy import Column, String, column, select, table

revision = "5"
down_revision = "4"


def upgrade() -> None:
    """From version 4 to version 5."""
    for name in ("tenant", "host"):
        op.add_column("deliveries", Column(name, String, nullable=False, server_default=""))
    jobs = table("jobs", column("id"), column("tenant"), column("callback_url"))
    deliveries = table(
        "deliveries", column("id"), column("job_id"), column("tenant"), column("host")
    )
    query = select(deliveries.c.id, jobs.c.tenant, jobs.c.callback_url).join_from(
        deliveries, jobs, jobs.c.id == deliveries.c.job_id
    )
    connection = op.get_bind()
    for row in connection.execute(query).all():
        place = {"tenant": row.tenant, "host": urlsplit(row.callback_url).netloc}
        connection.execute(deliveries.update().where(deliveries.c.id == row.id).values(**place))
