"""A store in PostgreSQL is backed up and restored like one in the data directory."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from pydantic import SecretStr

from service.backup.make import make_backup
from service.backup.manifest import BackupError
from service.backup.postgres_programs import DUMP_NAME
from service.backup.restore import restore_backup
from service.backup.verify import find_faults_of_backup, find_faults_of_data
from service.clouds.store import CloudStore
from service.database.store import StoreLostError, open_store
from service.settings import Settings
from service.storage.blobs import BlobStore
from tests.factories.jobs import TENANT, add, open_transitions
from tests.factories.postgres import Postgres
from tests.unit.service.backup.conftest import CONTENT, fill

Place = Callable[[str], Settings]


@pytest.fixture
def place(tmp_path: Path, postgres: Postgres) -> Place:
    """Settings of an empty data directory and an empty database."""

    def empty(name: str) -> Settings:
        url = SecretStr(postgres.new_database())
        return Settings(data_dir=tmp_path / name, database_url=url)

    return empty


@pytest.fixture
def used(place: Place) -> Settings:
    """A store with rows and files."""
    settings = place("data")
    with closing(open_store(settings)) as database:
        fill(settings, database)
    return settings


def test_all_is_there_again(used: Settings, place: Place, tmp_path: Path) -> None:
    manifest = make_backup(used, tmp_path / "copy")
    assert manifest.missing == []
    assert list(find_faults_of_backup(tmp_path / "copy")) == []
    anew = place("anew")
    restore_backup(anew, tmp_path / "copy")
    assert list(find_faults_of_data(anew)) == []
    assert not (anew.data_dir / DUMP_NAME).exists()
    with closing(open_store(anew)) as database:
        cloud = CloudStore(database, BlobStore(anew.data_dir), retention_s=1.0).get("lab", "door")
    assert BlobStore(anew.data_dir).path(cloud.sha256).read_bytes() == CONTENT


def test_rows_that_are_written_meanwhile_are_all_in_it_or_none(
    used: Settings, place: Place, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The files are those of the rows in the dump, whatever is added before pg_dump reads."""
    from service.backup import store_copy

    dump_database = store_copy.dump_database
    late: list[str] = []

    def add_and_dump(url: str, target: Path, *, snapshot: str) -> None:
        with closing(open_store(used)) as database:
            late.append(add(open_transitions(database)).id)
        dump_database(url, target, snapshot=snapshot)

    monkeypatch.setattr(store_copy, "dump_database", add_and_dump)
    make_backup(used, tmp_path / "copy")
    anew = place("anew")
    restore_backup(anew, tmp_path / "copy")
    with closing(open_store(anew)) as database:
        from service.jobs.queries import JobQueries

        assert JobQueries(database).get(TENANT, late[0]) is None


def test_what_is_not_empty_or_of_another_kind_is_refused(
    used: Settings, place: Place, tmp_path: Path
) -> None:
    make_backup(used, tmp_path / "copy")
    taken = used.model_copy(update={"data_dir": tmp_path / "new"})
    with pytest.raises(BackupError, match="the database has a job store"):
        restore_backup(taken, tmp_path / "copy")
    with pytest.raises(BackupError, match="set MPE_DATABASE_URL"):
        restore_backup(Settings(data_dir=tmp_path / "new"), tmp_path / "copy")
    assert not (tmp_path / "new").exists()


def test_a_failure_says_why_and_leaves_no_store(
    used: Settings, place: Place, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_backup(used, tmp_path / "copy")
    anew = place("anew")
    with monkeypatch.context() as patched:
        patched.setenv("PATH", "/nowhere")
        with pytest.raises(BackupError, match="pg_dump is not installed"):
            make_backup(used, tmp_path / "other")
        with pytest.raises(BackupError, match="pg_restore is not installed"):
            restore_backup(anew, tmp_path / "copy")
    assert not (tmp_path / "other").exists()
    with pytest.raises(StoreLostError):
        open_store(anew)
