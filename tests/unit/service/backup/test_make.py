"""A backup has all that the store names, as it was at one moment."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from service.backup import make as module
from service.backup.make import make_backup
from service.backup.manifest import BackupError, Manifest
from service.database.store import StoreLostError, open_store
from service.jobs.queries import JobQueries
from service.settings import Settings
from tests.factories.jobs import TENANT, add, open_transitions
from tests.unit.service.backup.conftest import CONTENT

BlobOf = Callable[[Path, bytes], Path]


def test_what_the_store_names_is_copied_and_nothing_else(
    settings: Settings, tmp_path: Path, blob_of: BlobOf
) -> None:
    manifest = make_backup(settings, tmp_path / "copy")
    assert manifest.missing == []
    assert Manifest.read(tmp_path / "copy") == manifest
    assert blob_of(tmp_path / "copy", CONTENT).is_file()
    kinds = sorted(file.path.partition("/")[0] for file in manifest.files)
    assert kinds == ["blobs", "blobs", "jobs.sqlite3", "store.mark", "uploads"]
    found = {p for p in (tmp_path / "copy").rglob("*") if p.is_file()}
    assert len(found) == len(manifest.files) + 1
    assert (tmp_path / "copy").stat().st_mode & 0o077 == 0
    assert not (tmp_path / "copy.partial").exists()


def test_a_store_that_is_written_meanwhile_is_copied_whole(
    settings: Settings, tmp_path: Path
) -> None:
    with closing(open_store(settings)) as database:
        transitions = open_transitions(database, queue_limit=1000)
        job = add(transitions)  # still in the write-ahead log
        make_backup(settings, tmp_path / "copy")
        add(transitions)
    copied = settings.model_copy(update={"data_dir": tmp_path / "copy"})
    with closing(open_store(copied)) as database:
        assert JobQueries(database).get(TENANT, job.id) is not None
        assert JobQueries(database).count("queued") == 2


def test_a_file_that_goes_meanwhile_makes_it_copy_again(
    settings: Settings, tmp_path: Path, blob_of: BlobOf, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its cloud is removed between the copy of the store and that of the files."""
    copies = []
    copy_store = module.copy_store

    def copy_and_remove(source: Settings, target: Path) -> object:
        described = copy_store(source, target)
        if not copies:
            with closing(open_store(settings)) as database, database.write() as connection:
                connection.exec_driver_sql("DELETE FROM clouds")
            blob_of(settings.data_dir, CONTENT).unlink()
        copies.append(described)
        return described

    monkeypatch.setattr(module, "copy_store", copy_and_remove)
    assert make_backup(settings, tmp_path / "copy").missing == []
    assert len(copies) == 2


def test_a_missing_or_damaged_file_is_told_and_the_rest_is_copied(
    settings: Settings, tmp_path: Path, blob_of: BlobOf
) -> None:
    blob_of(settings.data_dir, CONTENT).write_bytes(b"1 0 0")
    blob_of(settings.data_dir, b"other").unlink()
    manifest = make_backup(settings, tmp_path / "copy")
    assert len(manifest.missing) == 2
    assert all(name.startswith("blobs/") for name in manifest.missing)


def test_what_cannot_be_backed_up_is_refused(settings: Settings, tmp_path: Path) -> None:
    (tmp_path / "taken").mkdir()
    with pytest.raises(BackupError, match="exists"):
        make_backup(settings, tmp_path / "taken")
    (tmp_path / "copy.partial").mkdir()
    with pytest.raises(BackupError, match="interrupted"):
        make_backup(settings, tmp_path / "copy")
    with pytest.raises(BackupError, match="no job store"):
        make_backup(Settings(data_dir=tmp_path / "nothing"), tmp_path / "new")
    settings.sqlite_path.write_bytes(b"noise" * 1000)
    with pytest.raises(StoreLostError):
        make_backup(settings, tmp_path / "new")
    assert not (tmp_path / "new").exists()
