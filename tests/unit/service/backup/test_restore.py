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
from service.storage.open_blobs import open_blobs
from service.storage.store_mark import StoreMark
from tests.factories.s3 import S3Server, blob_settings
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


def test_blobs_of_a_bucket_are_backed_up_and_restored_to_another(
    s3: S3Server, tmp_path: Path
) -> None:
    used = Settings(data_dir=tmp_path / "used", blob=blob_settings(s3))
    with closing(open_store(used)) as database:
        blob = open_blobs(used).put([b"1 2 3\n"])
        CloudStore(database, open_blobs(used), retention_s=60).put("lab", "door", blob, "xyz")
    open_blobs(used).path(blob.sha256).unlink()
    make_backup(used, tmp_path / "copy")
    assert list(find_faults_of_data(used)) == []
    anew = Settings(data_dir=tmp_path / "anew", blob=blob_settings(s3))
    restore_backup(anew, tmp_path / "copy")
    open_blobs(anew).path(blob.sha256).unlink()
    assert open_blobs(anew).fetch(blob.sha256).read_bytes() == b"1 2 3\n"
    assert list(find_faults_of_data(anew)) == []
