"""Blobs, named by the SHA-256 hash of their content, in a directory."""

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

from service.storage.file_lock import exclusive_lock, is_unlocked


@dataclass(frozen=True, slots=True)
class Blob:
    """Stored content; equal contents are one blob."""

    sha256: str
    """Hash of the content, 64 hexadecimal digits."""
    size: int
    """Length in bytes."""


def blob_path(root: Path, sha256: str) -> Path:
    """Return the path of a blob below the data directory, whether it exists or not."""
    return root / "blobs" / sha256[:2] / sha256


class BlobWriter:
    """A blob that is being written; it becomes visible with `commit`, or leaves nothing behind.

    The file is locked meanwhile, which tells it from one that a killed process left.
    """

    def __init__(self, incoming: Path, install: Callable[[Path, Blob], None]) -> None:
        self._install = install
        self._file = tempfile.NamedTemporaryFile(  # noqa: SIM115
            dir=incoming, prefix="blob-", delete=False
        )
        fcntl.flock(self._file, fcntl.LOCK_EX)
        self._hash = hashlib.sha256()
        self._size = 0

    def __enter__(self) -> Self:
        """Return the writer itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Discard what was not committed."""
        self.discard()

    @property
    def size(self) -> int:
        """Number of bytes written so far."""
        return self._size

    @property
    def written(self) -> Blob:
        """The blob that `commit` would make now."""
        return Blob(self._hash.hexdigest(), self._size)

    def write(self, chunk: bytes | bytearray) -> None:
        """Append a chunk."""
        self._file.write(chunk)
        self._hash.update(chunk)
        self._size += len(chunk)

    def restart(self) -> None:
        """Drop what was written so far and begin again."""
        self._file.seek(0)
        self._file.truncate()
        self._hash = hashlib.sha256()
        self._size = 0

    def commit(self) -> Blob:
        """Make the blob durable under its name and return it."""
        self._file.flush()
        blob = self.written
        self._install(Path(self._file.name), blob)
        self._file.close()
        return blob

    def discard(self) -> None:
        """Remove what was written; does nothing after `commit`."""
        self._file.close()
        Path(self._file.name).unlink(missing_ok=True)


class BlobStore:
    """Blobs below a directory: written in `incoming`, then renamed to `blobs/ab/abcd...`.

    `service.storage.s3_blobs.S3BlobStore` keeps them in a bucket, behind the same interface.

    Parameters
    ----------
    root : Path
        Directory of `blobs`; shared by all processes of a service.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self.blobs = root / "blobs"
        self.incoming = root / "incoming"
        self._unneeded_since: dict[str, float] = {}
        for directory in (self.blobs, self.incoming):
            directory.mkdir(parents=True, exist_ok=True)

    def path(self, sha256: str) -> Path:
        """Return the path of a blob, whether it exists or not."""
        return blob_path(self.root, sha256)

    def exists(self, sha256: str) -> bool:
        """Return whether the blob is stored."""
        return self.path(sha256).exists()

    def fetch(self, sha256: str) -> Path:
        """Return the path of a blob, to be opened soon.

        Raises
        ------
        FileNotFoundError
            The blob is not stored.
        """
        path = self.path(sha256)
        path.stat()
        return path

    @contextmanager
    def hold(self, sha256: str) -> Iterator[Path]:
        """Keep the file of a blob at its path while the context lasts.

        Raises
        ------
        FileNotFoundError
            The blob is not stored.
        """
        yield self.fetch(sha256)

    def is_whole(self, sha256: str) -> bool:
        """Return whether what is stored has this hash.

        Raises
        ------
        FileNotFoundError
            The blob is not stored.
        """
        with self.path(sha256).open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest() == sha256

    def writer(self) -> BlobWriter:
        """Start a new blob."""
        return BlobWriter(self.incoming, self.install)

    def put(self, chunks: Iterable[bytes]) -> Blob:
        """Store the chunks as one blob."""
        with self.writer() as writer:
            for chunk in chunks:
                writer.write(chunk)
            return writer.commit()

    def adopt(self, path: Path) -> Blob:
        """Turn a finished file of the same file system into a blob; the file is moved."""
        with path.open("rb") as file:
            sha256 = hashlib.file_digest(file, "sha256").hexdigest()
        blob = Blob(sha256, path.stat().st_size)
        path.touch()
        self.install(path, blob)
        return blob

    def install(self, path: Path, blob: Blob) -> None:
        """Move a file to the name of its blob, durably; drop it when the blob exists."""
        final = self.path(blob.sha256)
        if not self._touch_existing(final):
            with path.open("rb") as file:
                os.fsync(file.fileno())
            final.parent.mkdir(exist_ok=True)
            with self.locked():
                path.replace(final)
        _fsync_directory(final.parent)
        path.unlink(missing_ok=True)

    def touch(self, sha256: str) -> None:
        """Make a blob as young as a new one, so that `collect` spares it for the grace time.

        Raises
        ------
        FileNotFoundError
            The blob has been removed.
        """
        with self.locked():
            os.utime(self.path(sha256))

    def discard_incoming(self) -> None:
        """Remove unfinished blobs of processes that were killed; nobody holds their locks."""
        for path in self.incoming.iterdir():
            if is_unlocked(path):
                path.unlink(missing_ok=True)

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keep `collect` and the installation of blobs apart, in all processes."""
        with exclusive_lock(self.root / "blobs.lock"):
            yield

    def collect(self, needed: Callable[[], set[str]], *, now: float, grace_s: float) -> int:
        """Remove blobs that have been neither written nor seen needed for the grace time.

        A reader of a row that names a blob has the grace time to open it, even if the row is
        removed meanwhile.

        Parameters
        ----------
        needed : callable
            Returns the hashes of the blobs that rows refer to. Called after the old blobs have been
            listed, so that a blob that a job takes up meanwhile is either needed or young.
        now : float
            Seconds since the epoch.
        grace_s : float
            Grace time in seconds.

        Returns
        -------
        int
            Number of removed blobs.
        """
        old = {path.name for path in self.blobs.glob("*/*") if _modified(path) < now - grace_s}
        unneeded = old - needed() if old else set()
        self._unneeded_since = {name: self._unneeded_since.get(name, now) for name in unneeded}
        over = [name for name, since in self._unneeded_since.items() if since <= now - grace_s]
        return sum(self._remove_old(self.path(name), now - grace_s) for name in over)

    def collect_shared(self, needed: Callable[[], set[str]], *, grace_s: float) -> int:
        """Remove what `collect` removes from a store that many data directories share."""
        return 0

    def _remove_old(self, path: Path, older_than: float) -> bool:
        with self.locked(), contextlib.suppress(FileNotFoundError):
            if path.stat().st_mtime < older_than:
                path.unlink()
                return True
        return False

    def _touch_existing(self, path: Path) -> bool:
        """Make a blob young and return True; False when it does not exist."""
        with self.locked(), contextlib.suppress(FileNotFoundError):
            os.utime(path)
            return True
        return False


def _modified(path: Path) -> float:
    """Return the time of the last change (seconds since the epoch); inf for a missing file."""
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
