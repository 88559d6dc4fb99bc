"""A restored directory is the one that was backed up; what is not whole is not restored."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from pydantic import SecretStr

from service.backup.make import make_backup
from service.backup.manifest import BackupError
from service.backup.restore import restore_backup
from service.backup.verify import find_faults_of_data
from service.clouds.store import CloudStore
from service.database.store import StoreLostError, open_store
from service.settings import Settings
from service.storage.blobs import BlobStore
from service.storage.store_mark import StoreMark
from tests.unit.service.backup.conftest import CONTENT

BlobOf = Callable[[Path, bytes], Path]


@pytest.fixture
def backup(settings: Settings, tmp_path: Path) -> Path:
    StoreMark(settings.data_dir).record_keys()
    make_backup(settings, tmp_path / "copy")
    return tmp_path / "copy"


@pytest.fixture
def empty(tmp_path: Path) -> Settings:
    return Settings(data_dir=tmp_path / "anew")


def test_all_is_there_again(backup: Path, empty: Settings) -> None:
    restore_backup(empty, backup)
    assert list(find_faults_of_data(empty)) == []
    assert StoreMark(empty.data_dir).had_keys
    assert len(list((empty.data_dir / "uploads").iterdir())) == 1
    with closing(open_store(empty)) as database:
        blobs = BlobStore(empty.data_dir)
        cloud = CloudStore(database, blobs, retention_s=1.0).get("lab", "door")
    assert blobs.path(cloud.sha256).read_bytes() == CONTENT


def test_only_a_whole_backup_is_restored(backup: Path, empty: Settings, blob_of: BlobOf) -> None:
    blob_of(backup, CONTENT).unlink()
    with pytest.raises(BackupError, match="not whole"):
        restore_backup(empty, backup)
    assert not empty.data_dir.exists()


def test_nothing_is_overwritten(backup: Path, settings: Settings) -> None:
    with pytest.raises(BackupError, match="not empty"):
        restore_backup(settings, backup)


def test_rows_of_another_database_are_not_mixed(backup: Path, empty: Settings) -> None:
    away = {"database_url": SecretStr("postgresql://there/x")}
    with pytest.raises(BackupError, match="MPE_DATABASE_URL"):
        restore_backup(empty.model_copy(update=away), backup)


def test_a_service_does_not_start_on_half_a_restore(
    backup: Path, empty: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(path: Path, target: Path) -> Path:
        if target.name == empty.sqlite_path.name:
            raise KeyboardInterrupt
        return replace(path, target)

    replace = Path.replace
    monkeypatch.setattr(Path, "replace", fail)
    with pytest.raises(KeyboardInterrupt):
        restore_backup(empty, backup)
    with pytest.raises(StoreLostError):
        open_store(empty)
