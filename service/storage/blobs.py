"""Blobs on disk, named by the SHA-256 of their content."""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import math
import os
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Self


@dataclass(frozen=True, slots=True)
class Blob:
    """A stored content: the same bytes are stored once."""

    sha256: str
    size: int
    """Length in bytes."""


class BlobWriter:
    """One blob being written; nothing is visible, and nothing stays behind, before `commit`.

    The file is locked meanwhile, so that nobody takes it for one that a dead process left.
    """

    def __init__(self, store: BlobStore) -> None:
        self._store = store
        self._file = tempfile.NamedTemporaryFile(  # noqa: SIM115
            dir=store.incoming, prefix="blob-", delete=False
        )
        fcntl.flock(self._file, fcntl.LOCK_EX)
        self._hash = hashlib.sha256()
        self._size = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.discard()

    @property
    def size(self) -> int:
        """Bytes written so far."""
        return self._size

    def write(self, chunk: bytes) -> None:
        """Append a chunk."""
        self._file.write(chunk)
        self._hash.update(chunk)
        self._size += len(chunk)

    def restart(self) -> None:
        """Forget what was written so far."""
        self._file.seek(0)
        self._file.truncate()
        self._hash = hashlib.sha256()
        self._size = 0

    def commit(self) -> Blob:
        """Make the blob durable under its name and return it."""
        self._file.flush()
        blob = Blob(self._hash.hexdigest(), self._size)
        self._store.install(Path(self._file.name), blob)
        self._file.close()
        return blob

    def discard(self) -> None:
        """Remove what was written; does nothing after `commit`."""
        self._file.close()
        Path(self._file.name).unlink(missing_ok=True)


class BlobStore:
    """Blobs below a directory: `blobs/ab/abcd...`, written in `incoming`, then renamed."""

    def __init__(self, root: Path, *, incoming: Path | None = None) -> None:
        self.root = root
        self.blobs = root / "blobs"
        self.incoming = incoming or root / "incoming"
        self._unneeded_since: dict[str, float] = {}
        for directory in (self.blobs, self.incoming):
            directory.mkdir(parents=True, exist_ok=True)

    def path(self, sha256: str) -> Path:
        """Where the blob lies."""
        return self.blobs / sha256[:2] / sha256

    def writer(self) -> BlobWriter:
        """Begin a new blob."""
        return BlobWriter(self)

    def discard_incoming(self) -> None:
        """Remove what former processes were writing when they ended."""
        for path in self.incoming.iterdir():
            with contextlib.suppress(FileNotFoundError, BlockingIOError), path.open("rb") as file:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                path.unlink()

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keep `collect` and the renaming of new blobs, in whatever process, apart."""
        with (self.root / "blobs.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            yield

    def touch(self, sha256: str) -> None:
        """Count the blob as new, so that `collect` spares it until a row that needs it is stored.

        FileNotFoundError when it has been removed.
        """
        with self.locked():
            os.utime(self.path(sha256))

    def collect(self, needed: Callable[[], set[str]], *, now: float, grace_s: float) -> int:
        """Remove blobs that were written, and last seen needed, the grace ago; returns how many.

        Who has read a row that names a blob has that long to open it, though the row is gone.
        What is needed is asked after the old blobs have been listed: a blob that a job has taken
        up since is either needed or new.
        """
        old = {path.name for path in self.blobs.glob("*/*") if _modified(path) < now - grace_s}
        unneeded = old - needed() if old else set()
        self._unneeded_since = {name: self._unneeded_since.get(name, now) for name in unneeded}
        over = [name for name, since in self._unneeded_since.items() if since <= now - grace_s]
        return sum(self._remove_old(self.path(name), now - grace_s) for name in over)

    def _remove_old(self, path: Path, older_than: float) -> bool:
        with self.locked(), contextlib.suppress(FileNotFoundError):
            if path.stat().st_mtime < older_than:
                path.unlink()
                return True
        return False

    def adopt(self, path: Path) -> Blob:
        """Make a finished file of the same file system a blob; the file is gone then."""
        with path.open("rb") as file:
            sha256 = hashlib.file_digest(file, "sha256").hexdigest()
        blob = Blob(sha256, path.stat().st_size)
        path.touch()
        self.install(path, blob)
        return blob

    def install(self, path: Path, blob: Blob) -> None:
        """Give the file the blob's name, durably; drop it when the blob is there already."""
        final = self.path(blob.sha256)
        if not self._is_there(final):
            with path.open("rb") as file:
                os.fsync(file.fileno())
            final.parent.mkdir(exist_ok=True)
            with self.locked():
                path.replace(final)
        _fsync_directory(final.parent)
        path.unlink(missing_ok=True)

    def _is_there(self, final: Path) -> bool:
        """Whether the blob is stored already; it counts as new then."""
        with self.locked():
            if final.exists():
                final.touch()
                return True
        return False

    def put(self, chunks: Iterable[bytes]) -> Blob:
        """Store the chunks as one blob."""
        with self.writer() as writer:
            for chunk in chunks:
                writer.write(chunk)
            return writer.commit()


def _modified(path: Path) -> float:
    """Time in seconds since the epoch; never, when another service has removed the file."""
    try:
        return path.stat().st_mtime
    except FileNotFoundError:
        return math.inf


def _fsync_directory(directory: Path) -> None:
    descriptor = os.open(directory, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
