"""Run by Alembic for each command: on the connection, and in the transaction, of the caller."""

from __future__ import annotations

from alembic import context

from service.database.tables import metadata

context.configure(connection=context.config.attributes["connection"], target_metadata=metadata)
context.run_migrations()
