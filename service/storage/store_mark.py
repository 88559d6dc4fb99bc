"""Mark of a data directory: it had a job store, and perhaps keys."""

from __future__ import annotations

from pathlib import Path

STORE_MARK = "store.mark"
KEYS_MARK = "keys.mark"


class StoreMark:
    """Two files beside the job store that outlast it."""

    def __init__(self, data_dir: Path) -> None:
        self._data_dir = data_dir

    @property
    def is_used(self) -> bool:
        """Whether the directory had a job store; its files tell it where the mark is missing."""
        return (self._data_dir / STORE_MARK).exists() or self._has_files()

    @property
    def had_keys(self) -> bool:
        """Whether the store had a key at some time."""
        return (self._data_dir / KEYS_MARK).exists()

    def make(self) -> None:
        """Record that the directory has a store."""
        self._write(STORE_MARK, "This directory has a job store. Do not remove this file.\n")

    def record_keys(self) -> None:
        """Record that the store has a key: it never serves requests without one again."""
        self._write(KEYS_MARK, "The job store of this directory has had API keys.\n")

    def _write(self, name: str, text: str) -> None:
        path = self._data_dir / name
        if not path.exists():
            path.write_text(text)

    def _has_files(self) -> bool:
        folders = (self._data_dir / name for name in ("blobs", "uploads"))
        return any(path.is_file() for folder in folders for path in folder.rglob("*"))
