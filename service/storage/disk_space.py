"""Free space of the data directory: reserved for what is announced, with a file to fall back on."""

from __future__ import annotations

import contextlib
import os
import shutil
import threading
from pathlib import Path

FALLBACK_BYTES = 8 * 2**20
"""Size of the file that is removed when the disk is full, in bytes: enough for the rows that have
to be written before more can be removed."""
FULL_BYTES = FALLBACK_BYTES // 8
"""Free bytes below which the disk counts as full."""
FALLBACK_NAME = "reserve"
MIN_FREE_FILES = 1000
"""Files that the file system can still hold, below which it counts as short."""


class DiskSpace:
    """Free space of one directory; safe for threads.

    Parameters
    ----------
    data_dir : Path
        Directory whose file system is watched.
    min_free_bytes : int
        Bytes that nothing announced may use.
    """

    def __init__(self, data_dir: Path, min_free_bytes: int) -> None:
        self._data_dir = data_dir
        self._min_free_bytes = min_free_bytes
        self._reserved_bytes = 0
        self._lock = threading.Lock()

    @property
    def free_bytes(self) -> int:
        """Bytes that are free now, those reserved included."""
        return shutil.disk_usage(self._data_dir).free

    @property
    def is_short(self) -> bool:
        """Whether less than the minimum is free, or few more files can be made."""
        return self.free_bytes < self._min_free_bytes or self._is_short_of_files

    @property
    def _is_short_of_files(self) -> bool:
        found = os.statvfs(self._data_dir)
        return found.f_files > 0 and found.f_favail < MIN_FREE_FILES  # 0: it has no limit

    def reserve(self, size: int) -> bool:
        """Reserve bytes that are about to be written, until `release`; return False if too many."""
        if self._is_short_of_files:
            return False
        with self._lock:
            if self.free_bytes - self._reserved_bytes - size < self._min_free_bytes:
                return False
            self._reserved_bytes += size
        return True

    def release(self, size: int) -> None:
        """End a reservation."""
        with self._lock:
            self._reserved_bytes -= size

    def adjust_fallback(self) -> None:
        """Remove the fallback file when the disk is full; write it again when there is room."""
        path, free_bytes = self._data_dir / FALLBACK_NAME, self.free_bytes
        if free_bytes < FULL_BYTES:
            path.unlink(missing_ok=True)
        elif free_bytes >= self._min_free_bytes + FALLBACK_BYTES and not path.exists():
            _allocate(path, FALLBACK_BYTES)


def _allocate(path: Path, size: int) -> None:
    """Make a file that takes `size` bytes of the disk; make none where that fails."""
    try:
        with path.open("wb") as file:
            os.posix_fallocate(file.fileno(), 0, size)
    except OSError:
        with contextlib.suppress(OSError):
            path.unlink()
