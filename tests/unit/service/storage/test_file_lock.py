"""A lock has one holder, and ends with him."""

from __future__ import annotations

from pathlib import Path

import pytest

from service.storage.file_lock import exclusive_lock, is_unlocked


def test_a_lock_is_held_while_the_context_lasts(tmp_path: Path) -> None:
    path = tmp_path / "lock"
    assert is_unlocked(path)
    with exclusive_lock(path):
        assert not is_unlocked(path)
    assert is_unlocked(path)


def test_a_lock_ends_with_an_exception(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), exclusive_lock(tmp_path / "lock"):
        raise ZeroDivisionError
    assert is_unlocked(tmp_path / "lock")


def test_locking_keeps_the_content(tmp_path: Path) -> None:
    path = tmp_path / "lock"
    path.write_bytes(b"content")
    with exclusive_lock(path):
        is_unlocked(path)
    assert path.read_bytes() == b"content"
