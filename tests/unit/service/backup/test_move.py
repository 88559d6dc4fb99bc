"""A store moves from a directory into PostgreSQL and a bucket, and back, whole."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from pydantic import SecretStr
from sqlalchemy import select

from service.auth.keys import KeyLimits, KeyStore
from service.backup.manifest import BackupError
from service.backup.move import TABLES, Moved, directory_settings, move_store
from service.database.store import open_store
from service.database.tables import uploads
from service.jobs.worker_slots import WorkerSlots
from service.settings import Settings
from service.storage.open_blobs import open_blobs
from service.storage.store_mark import StoreMark
from tests.factories.postgres import Postgres
from tests.factories.s3 import S3Server, blob_settings
from tests.unit.service.backup.conftest import CONTENT


@pytest.fixture
def cluster(postgres: Postgres, s3: S3Server, tmp_path: Path) -> Settings:
    url = SecretStr(postgres.new_database())
    return Settings(data_dir=tmp_path / "own", database_url=url, blob=blob_settings(s3))


def move(source: Settings, target: Settings) -> tuple[Moved, list[tuple[str, float]]]:
    told: list[tuple[str, float]] = []
    return move_store(source, target, lambda what, share: told.append((what, share))), told


def rows(settings: Settings) -> dict[str, list[Any]]:
    """All rows but those of unfinished uploads, in order."""
    with closing(open_store(settings)) as database, database.read() as connection:
        found = {
            table.name: [tuple(row) for row in connection.execute(select(table))]
            for table in TABLES
            if table is not uploads
        }
    return {name: sorted(of_table, key=repr) for name, of_table in found.items()}


def test_it_comes_back_as_it_was(settings: Settings, cluster: Settings, tmp_path: Path) -> None:
    with closing(open_store(settings)) as database:
        KeyStore(database).create("lab", "laptop", KeyLimits())
    before = rows(settings)
    there, told = move(settings, cluster)
    assert (there.files, there.missing, there.left_out) == (2, [], 1)
    assert [what for what, share in told if share == 1.0] == ["files", "rows"]
    assert rows(cluster) == before
    back = directory_settings(cluster, tmp_path / "back")
    again, _ = move(cluster, back)
    assert (again.rows, again.files) == (there.rows, 2)
    assert rows(back) == before
    assert StoreMark(back.data_dir).had_keys
    sha256 = before["clouds"][0][2]
    assert open_blobs(back).fetch(sha256).read_bytes() == CONTENT


def test_a_file_that_is_missing_is_told(settings: Settings, cluster: Settings) -> None:
    next(settings.data_dir.glob("blobs/*/*")).unlink()
    moved, _ = move(settings, cluster)
    assert moved.files + len(moved.missing) >= 2


def test_what_is_in_use_is_not_touched(
    settings: Settings, cluster: Settings, tmp_path: Path
) -> None:
    with pytest.raises(BackupError, match="no job store"):
        move(directory_settings(cluster, tmp_path / "nothing"), cluster)
    with closing(open_store(cluster)) as database:
        slots = WorkerSlots(database, 1)
        slots.announce()
        with pytest.raises(BackupError, match="services run"):
            move(settings, cluster)
        slots.withdraw()
    move(settings, cluster)
    with pytest.raises(BackupError, match="the target has jobs"):
        move(settings, cluster)
