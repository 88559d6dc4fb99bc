"""Bringing the job store to the schema of this release; the steps are in service/migrations."""

from __future__ import annotations

import logging
from pathlib import Path

from alembic import command
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Connection, Integer, column, inspect, select, table, text

STEPS = Path(__file__).parent / "migrations"

log = logging.getLogger(__name__)


def migrate(connection: Connection, *, to: str = "head", steps: Path = STEPS) -> None:
    """Bring the store to a version, within the caller's transaction.

    RuntimeError when a later release has written it.
    """
    config = Config(attributes={"connection": connection})
    config.set_main_option("script_location", str(steps).replace("%", "%%"))
    _number(connection, config)
    found = _version(connection)
    _check_version(found, ScriptDirectory.from_config(config))
    command.upgrade(config, to)
    if found != (reached := _version(connection)):
        log.info("the job store was brought from version %s to %s", found or "0", reached)


def _version(connection: Connection) -> str | None:
    return MigrationContext.configure(connection).get_current_revision()


def _check_version(found: str | None, known: ScriptDirectory) -> None:
    if found is not None and found not in {step.revision for step in known.walk_revisions()}:
        raise RuntimeError(
            f"the job store has version {found}, this release knows {known.get_current_head()}: "
            "use the release that wrote it, or a later one"
        )


def _number(connection: Connection, config: Config) -> None:
    """A store from before Alembic counted its versions in a table of its own; the last was 1."""
    if inspect(connection).has_table("schema_version"):
        counted = table("schema_version", column("version", Integer))
        command.stamp(config, str(connection.scalar(select(counted.c.version))))
        connection.execute(text("DROP TABLE schema_version"))
