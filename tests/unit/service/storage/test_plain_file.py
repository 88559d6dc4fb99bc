"""Only regular files with a single name are opened."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from service.storage.plain_file import NotPlainFileError, is_plain_file, open_plain_file


def test_a_regular_file_is_opened(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("content")
    with open_plain_file(tmp_path / "file") as file:
        assert file.read() == b"content"


@pytest.mark.parametrize("kind", ["missing", "symbolic link", "hard link", "folder", "pipe"])
def test_anything_else_is_refused(tmp_path: Path, kind: str) -> None:
    path, other = tmp_path / "path", tmp_path / "other"
    other.write_text("secret")
    makes = {
        "missing": lambda: None,
        "symbolic link": lambda: path.symlink_to(other),
        "hard link": lambda: path.hardlink_to(other),
        "folder": path.mkdir,
        "pipe": lambda: os.mkfifo(path),
    }
    makes[kind]()
    assert not is_plain_file(path)
    with pytest.raises(NotPlainFileError):
        open_plain_file(path)
