"""A store that is lost or damaged stops the start; nothing is changed."""

from __future__ import annotations

import os
import sqlite3
from pathlib import Path

import pytest

from service.database.store import StoreLostError, check_store, open_store
from service.settings import Settings
from service.storage.blobs import BlobStore
from service.storage.store_mark import StoreMark
from tests.factories.jobs import add, open_transitions


@pytest.fixture
def settings(url: str, tmp_path: Path) -> Settings:
    """Settings of a directory that has no store yet."""
    database_url = None if url.startswith("sqlite") else url
    return Settings(data_dir=tmp_path / "data", database_url=database_url)


@pytest.fixture
def sqlite(tmp_path: Path) -> Settings:
    """Settings of a directory with a store of some jobs."""
    settings = Settings(data_dir=tmp_path / "data")
    database = open_store(settings)
    for _ in range(50):
        add(open_transitions(database))
    database.close()
    return settings


def contents(directory: Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in directory.rglob("*") if path.is_file()}


def test_a_new_directory_gets_a_store_that_opens_again(settings: Settings) -> None:
    check_store(settings)
    for _ in range(2):
        open_store(settings).close()
        check_store(settings)


@pytest.mark.parametrize("how", ["missing", "empty"])
@pytest.mark.parametrize("is_marked", [True, False], ids=["marked", "of an earlier release"])
def test_a_lost_store_is_refused_and_nothing_is_changed(
    sqlite: Settings, how: str, is_marked: bool
) -> None:
    BlobStore(sqlite.data_dir).put([b"a cloud"])
    for path in sqlite.data_dir.glob("jobs.sqlite3*"):
        path.unlink()
    if how == "empty":
        sqlite.sqlite_path.touch()
    if not is_marked:
        (sqlite.data_dir / "store.mark").unlink()
    before = contents(sqlite.data_dir)
    for refuse in (check_store, open_store):
        with pytest.raises(StoreLostError, match=r"jobs\.sqlite3 is missing or empty"):
            refuse(sqlite)
    assert contents(sqlite.data_dir) == before


def test_an_empty_database_is_refused_for_a_used_directory(settings: Settings) -> None:
    settings.data_dir.mkdir()
    StoreMark(settings.data_dir).make()
    with pytest.raises(StoreLostError, match="empty"):
        open_store(settings)


def test_a_damaged_page_is_refused(sqlite: Settings) -> None:
    connection = sqlite3.connect(sqlite.sqlite_path)
    query = "SELECT rootpage FROM sqlite_master WHERE name = 'jobs'"
    (page,) = connection.execute(query).fetchone()
    (size,) = connection.execute("PRAGMA page_size").fetchone()
    connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    connection.close()
    with sqlite.sqlite_path.open("r+b") as file:
        file.seek(size * (page - 1))
        file.write(os.urandom(size))
    with pytest.raises(StoreLostError, match="is damaged"):
        check_store(sqlite)


def test_a_file_that_is_no_database_is_refused(sqlite: Settings) -> None:
    sqlite.sqlite_path.write_bytes(b"noise" * 10_000)
    with pytest.raises(StoreLostError, match="is damaged"):
        check_store(sqlite)
