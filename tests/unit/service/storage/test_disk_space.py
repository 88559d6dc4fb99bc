"""Space that is reserved, and the file that is given up when the disk is full."""

from __future__ import annotations

import os
import shutil
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import pytest

from service.storage.disk_space import FALLBACK_BYTES, FALLBACK_NAME, DiskSpace

MIN_FREE = 100 * 2**20


@dataclass
class Disk:
    """A disk with as much free space as the test wants."""

    free: int = 2**40


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Disk:
    disk = Disk()
    monkeypatch.setattr(shutil, "disk_usage", lambda path: disk)
    return disk


def test_reservations_leave_the_minimum(disk: Disk, tmp_path: Path) -> None:
    disk.free = MIN_FREE + 100
    space = DiskSpace(tmp_path, MIN_FREE)
    assert space.reserve(60)
    assert not space.reserve(41)
    assert space.reserve(40)
    assert not space.reserve(1)
    space.release(60)
    assert space.reserve(60)
    assert not space.is_short


def test_less_than_the_minimum_is_short(disk: Disk, tmp_path: Path) -> None:
    disk.free = MIN_FREE - 1
    space = DiskSpace(tmp_path, MIN_FREE)
    assert space.is_short
    assert not space.reserve(0)


@pytest.mark.parametrize(("all_files", "left", "is_short"), [(10**6, 999, True), (0, 0, False)])
def test_a_disk_that_holds_few_more_files_is_short(
    all_files: int,
    left: int,
    is_short: bool,
    disk: Disk,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """However many bytes are free; some file systems have no such limit."""
    found = SimpleNamespace(f_files=all_files, f_favail=left)
    monkeypatch.setattr(os, "statvfs", lambda path: found)
    space = DiskSpace(tmp_path, MIN_FREE)
    assert space.is_short == is_short
    assert space.reserve(1) != is_short


def test_the_fallback_file_is_given_up_when_the_disk_is_full_and_made_again(
    disk: Disk, tmp_path: Path
) -> None:
    space, path = DiskSpace(tmp_path, MIN_FREE), tmp_path / FALLBACK_NAME
    space.adjust_fallback()
    assert path.stat().st_size == FALLBACK_BYTES
    disk.free = MIN_FREE
    space.adjust_fallback()
    assert path.exists()
    disk.free = 0
    space.adjust_fallback()
    assert not path.exists()
    disk.free = MIN_FREE
    space.adjust_fallback()
    assert not path.exists()
    disk.free = MIN_FREE + FALLBACK_BYTES
    space.adjust_fallback()
    assert path.exists()
