"""Migration of the database to the schema of this release, by Alembic."""

from __future__ import annotations

import logging
from pathlib import Path

from alembic import command
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Connection, Integer, column, inspect, select, table, text

STEPS = Path(__file__).parent / "migrations"
"""Folder of the Alembic scripts, one file a version."""

log = logging.getLogger(__name__)


def is_current(connection: Connection, *, steps: Path = STEPS) -> bool:
    """Return whether the database has the schema of this release."""
    head = ScriptDirectory.from_config(_configure(connection, steps)).get_current_head()
    return _current_version(connection) == head


def migrate(connection: Connection, *, to: str = "head", steps: Path = STEPS) -> None:
    """Migrate the database to a version, within the caller's transaction.

    Raises
    ------
    RuntimeError
        A later release has written it.
    """
    config = _configure(connection, steps)
    _adopt_schema_version(connection, config)
    found = _current_version(connection)
    _check_version(found, ScriptDirectory.from_config(config))
    command.upgrade(config, to)
    if found != (reached := _current_version(connection)):
        log.info("the job store was migrated from version %s to %s", found or "0", reached)


def _configure(connection: Connection, steps: Path) -> Config:
    config = Config(attributes={"connection": connection})
    config.set_main_option("script_location", str(steps).replace("%", "%%"))
    return config


def _current_version(connection: Connection) -> str | None:
    return MigrationContext.configure(connection).get_current_revision()


def _check_version(found: str | None, known: ScriptDirectory) -> None:
    if found is not None and found not in {step.revision for step in known.walk_revisions()}:
        raise RuntimeError(
            f"the job store has version {found}, this release knows {known.get_current_head()}: "
            "use the release that wrote it, or a later one"
        )


def _adopt_schema_version(connection: Connection, config: Config) -> None:
    """Replace the version table of releases that did not use Alembic yet; their last was 1."""
    if inspect(connection).has_table("schema_version"):
        counted = table("schema_version", column("version", Integer))
        command.stamp(config, str(connection.scalar(select(counted.c.version))))
        connection.execute(text("DROP TABLE schema_version"))
