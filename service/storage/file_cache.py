"""Files of the data directory that can be had again, bounded in bytes by their last use."""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from service.storage.decoded_cache import DIRECTORY

RECENT_S = 60.0
"""Age of the last use, in seconds, below which a file is kept: its reader has yet to open it."""


@dataclass(frozen=True, slots=True, order=True)
class _CachedFile:
    used_at: float
    size: int
    path: Path


class FileCache:
    """Files below `blobs` and of decoded clouds; safe for threads of one process.

    Parameters
    ----------
    root : Path
        Data directory.
    max_bytes : int
        Length of all files together; those that are pinned or were just used may exceed it.
    """

    def __init__(self, root: Path, max_bytes: int) -> None:
        self._root = root
        self._max_bytes = max_bytes
        self._pins: Counter[Path] = Counter()
        self._lock = threading.Lock()

    @contextmanager
    def pin(self, path: Path) -> Iterator[None]:
        """Keep a file, if it exists or is made meanwhile, until the context ends."""
        with self._lock:
            self._pins[path] += 1
        try:
            yield
        finally:
            with self._lock:
                self._pins[path] -= 1
                self._pins += Counter()  # drops the zeros

    def shrink(self) -> None:
        """Remove the files that were not used for longest until the rest fits."""
        with self._lock:
            files = sorted(self._find())
            over = sum(file.size for file in files) - self._max_bytes
            for file in files:
                if over <= 0 or file.used_at > time.time() - RECENT_S:
                    return
                if file.path not in self._pins:
                    file.path.unlink(missing_ok=True)
                    over -= file.size

    def _find(self) -> Iterator[_CachedFile]:
        for pattern in ("blobs/*/*", f"{DIRECTORY}/*"):
            for path in self._root.glob(pattern):
                try:
                    status = path.stat()
                except FileNotFoundError:
                    continue
                yield _CachedFile(max(status.st_mtime, status.st_atime), status.st_size, path)
