"""A file of SQLite whose one writer is another program: `mpe keys`, or one that has stopped."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from service.auth.keys import KeyLimits, KeyStore
from service.database import sqlite
from service.database.engine import open_database
from service.problems import NotReadyError


@pytest.fixture
def url(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A store of this release, whose waits for the writer are short."""
    path = tmp_path / "jobs.sqlite3"
    open_database(f"sqlite:///{path}").close()
    pragmas = ("busy_timeout=20", *sqlite.PRAGMAS[1:])
    monkeypatch.setattr(sqlite, "PRAGMAS", pragmas)
    return f"sqlite:///{path}"


@pytest.fixture
def other_writer(url: str) -> Iterator[sqlite3.Connection]:
    """Another program in the middle of a transaction."""
    with closing(sqlite3.connect(url.removeprefix("sqlite:///"))) as connection:
        connection.isolation_level = None
        connection.execute("BEGIN IMMEDIATE")
        yield connection


def test_a_store_is_opened_and_read_while_another_program_writes(
    url: str, other_writer: sqlite3.Connection
) -> None:
    with closing(open_database(url)) as database:
        assert KeyStore(database).all() == []


def test_who_cannot_write_is_told_to_come_again_and_can_then(
    url: str, other_writer: sqlite3.Connection
) -> None:
    with closing(open_database(url)) as database:
        keys = KeyStore(database)
        with pytest.raises(NotReadyError) as refused:
            keys.create("lab", "", KeyLimits())
        assert "Retry-After" in refused.value.headers
        other_writer.execute("COMMIT")
        keys.create("lab", "", KeyLimits())
        assert len(keys.all()) == 1
