"""Every lost or changed byte shows."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from service.backup.make import make_backup
from service.backup.manifest import NAME, BackupError
from service.backup.verify import find_faults_of_backup, find_faults_of_data
from service.settings import Settings
from tests.unit.service.backup.conftest import CONTENT

BlobOf = Callable[[Path, bytes], Path]


def test_a_whole_backup_has_no_faults(settings: Settings, tmp_path: Path) -> None:
    make_backup(settings, tmp_path / "copy")
    assert list(find_faults_of_backup(tmp_path / "copy")) == []
    assert list(find_faults_of_data(settings)) == []


def test_each_file_of_a_backup_is_compared(settings: Settings, tmp_path: Path) -> None:
    backup = tmp_path / "copy"
    for file in make_backup(settings, backup).files:
        path, content = backup / file.path, (backup / file.path).read_bytes()
        path.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
        assert f"{file.path} is damaged" in list(find_faults_of_backup(backup))
        path.unlink()
        assert f"{file.path} is missing" in list(find_faults_of_backup(backup))
        path.write_bytes(content)
    assert list(find_faults_of_backup(backup)) == []


@pytest.mark.parametrize("content", [None, b"{}", b"\xff", b'{"files": [{"path": "../x"}]}'])
def test_a_backup_without_a_manifest_is_none(
    settings: Settings, tmp_path: Path, content: bytes | None
) -> None:
    make_backup(settings, tmp_path / "copy")
    manifest = tmp_path / "copy" / NAME
    manifest.unlink() if content is None else manifest.write_bytes(content)
    with pytest.raises(BackupError):
        list(find_faults_of_backup(tmp_path / "copy"))


def test_files_of_the_data_directory_are_compared(settings: Settings, blob_of: BlobOf) -> None:
    changed = blob_of(settings.data_dir, CONTENT)
    changed.write_bytes(b"9" + CONTENT[1:])
    lost = blob_of(settings.data_dir, b"other")
    lost.unlink()
    faults = set(find_faults_of_data(settings))
    names = (path.relative_to(settings.data_dir) for path in (changed, lost))
    assert faults == {f"{next(names)} is damaged", f"{next(names)} is missing"}
