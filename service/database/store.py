"""The job store of a data directory: checked before it is opened, so that a lost one is noticed.

A mark in the directory tells that there was a store, and whether it had keys. A service whose store
is missing, empty or damaged does not start: it would let everybody in, and remove every file.
"""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

from sqlalchemy import create_engine, inspect, make_url

from service.database.engine import Database, open_database
from service.database.errors import translate_errors
from service.problems import NotReadyError
from service.settings import Settings
from service.storage.store_mark import StoreMark

HEALTHY = "ok"
"""Answer of SQLite's quick_check about a database without damage."""


class StoreLostError(RuntimeError):
    """The job store of a data directory is missing, empty or damaged."""


def open_store(settings: Settings) -> Database:
    """Open the job store, which must be there if the data directory has been used, and mark it.

    Raises
    ------
    StoreLostError
        It is missing or empty.
    NotReadyError
        The database does not answer.
    RuntimeError
        A later release has written it.
    """
    settings.data_dir.mkdir(parents=True, exist_ok=True)
    mark = StoreMark(settings.data_dir)
    if mark.is_used and not has_tables(settings):
        raise StoreLostError(_describe_loss(settings))
    database = open_database(settings.store_url)
    mark.make()
    return database


def check_store(settings: Settings) -> None:
    """Check that the job store is whole, as far as a start has time for.

    Raises
    ------
    StoreLostError
        It is missing, empty or damaged.
    NotReadyError
        The database does not answer.
    """
    if settings.database_url is None and settings.sqlite_path.exists():
        _check_sqlite(settings.sqlite_path)
    if StoreMark(settings.data_dir).is_used and not has_tables(settings):
        raise StoreLostError(_describe_loss(settings))


def _check_sqlite(path: Path) -> None:
    try:
        with closing(sqlite3.connect(path)) as connection:
            (found,) = connection.execute("PRAGMA quick_check(1)").fetchone()
    except sqlite3.OperationalError as error:
        raise NotReadyError(f"the job store {path} cannot be opened: {error}") from error
    except sqlite3.DatabaseError as error:
        found = str(error)
    if found != HEALTHY:
        raise StoreLostError(
            f"the job store {path} is damaged ({found}): restore the data directory from a "
            "backup; nothing was changed"
        )


def has_tables(settings: Settings) -> bool:
    """Return whether there is a job store.

    Raises
    ------
    NotReadyError
        The database does not answer.
    """
    url = make_url(settings.store_url)
    if settings.database_url is None:
        if not settings.sqlite_path.exists():
            return False
    else:
        url = url.set(drivername="postgresql+psycopg")
    engine = create_engine(url, hide_parameters=True)
    try:
        with translate_errors():
            return inspect(engine).has_table("jobs")
    finally:
        engine.dispose()


def _describe_loss(settings: Settings) -> str:
    where = (
        f"{settings.sqlite_path} is missing or empty"
        if settings.database_url is None
        else "the database of MPE_DATABASE_URL is empty"
    )
    return (
        f"the job store is lost: {where}, but {settings.data_dir} holds the files of a store. "
        "Restore the store from a backup, or set MPE_DATA_DIR to an empty directory to begin "
        "anew; nothing was changed"
    )
