"""The doctor names what would be refused, and how to mend it."""

from __future__ import annotations

from pathlib import Path

import pytest

from service.cli.doctor import look_at_disk, look_at_kernels, look_at_memory
from service.settings import Settings


def test_a_disk_below_its_floor_is_a_fault(tmp_path: Path) -> None:
    folder = tmp_path / "not" / "there"
    assert look_at_disk(Settings(data_dir=folder, min_free_disk_bytes=0)).fault is None
    fault = look_at_disk(Settings(data_dir=folder, min_free_disk_bytes=2**60)).fault
    assert fault is not None
    assert "MPE_MIN_FREE_DISK_BYTES" in fault
    assert not folder.exists()


def test_memory_below_its_floor_is_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mpe_core.machine.memory_left", lambda: 1000)
    assert look_at_memory(Settings(min_free_memory_bytes=0)).fault is None
    fault = look_at_memory(Settings(min_free_memory_bytes=2000)).fault
    assert fault is not None
    assert "MPE_MIN_FREE_MEMORY_BYTES" in fault


def test_kernels_are_counted_where_they_are_kept(tmp_path: Path) -> None:
    assert look_at_kernels(tmp_path / "none").state.startswith("none compiled")
    (tmp_path / "kernel.nbc").touch()
    assert look_at_kernels(tmp_path).state.startswith("1 compiled")
