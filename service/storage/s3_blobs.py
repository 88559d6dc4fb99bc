"""Blobs in a bucket, with the files that are used here kept in the data directory.

A blob is one or more equal objects `blobs/ab/abcd.../<instance>`. Whoever is about to refer to a
blob makes a new instance, by a copy within the store, unless it has made one a moment ago.
`collect_shared` removes only instances that it has seen without need for the grace time. So it
never removes one that a new job takes up, without locks and without clocks that agree.
"""

from __future__ import annotations

import logging
import os
import secrets
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from service.storage.blobs import Blob, BlobStore, BlobWriter
from service.storage.bucket import Bucket
from service.storage.file_cache import FileCache

PREFIX = "blobs/"
YOUNG_SHARE = 0.25
"""Share of the grace time in which an instance that this process made need not be made again."""

log = logging.getLogger(__name__)


class WrongContentError(Exception):
    """An object is not the file that was announced."""


class S3BlobStore(BlobStore):
    """Blobs of a bucket that any number of processes use, each with a data directory of its own.

    Parameters
    ----------
    root : Path
        Data directory; `blobs` in it is a cache.
    bucket : Bucket
        Where the blobs are.
    cache_bytes : int
        Length of the files that the data directory keeps, in bytes.
    grace_s : float
        Grace time of the clean-up, in seconds.
    """

    def __init__(self, root: Path, bucket: Bucket, *, cache_bytes: int, grace_s: float) -> None:
        super().__init__(root)
        self._bucket = bucket
        self._cache = FileCache(root, cache_bytes)
        self._young_s = YOUNG_SHARE * grace_s
        self._made_at: dict[str, float] = {}
        self._downloads = [threading.Lock() for _ in range(256)]
        self._removable_since: dict[str, float] = {}

    def exists(self, sha256: str) -> bool:
        """Return whether the blob is in the bucket."""
        return self._is_young(sha256) or bool(self._instances(sha256))

    def fetch(self, sha256: str) -> Path:
        """Return the path of a blob, which is downloaded where it is missing here.

        Raises
        ------
        FileNotFoundError
            The bucket has no blob with this content.
        """
        path = self.path(sha256)
        with self._downloads[int(sha256[:2], 16)]:
            try:
                os.utime(path)
            except FileNotFoundError:
                self._download(sha256)
                self._cache.shrink()
        return path

    @contextmanager
    def hold(self, sha256: str) -> Iterator[Path]:
        """Keep the file of a blob in the data directory while the context lasts."""
        path = self.path(sha256)
        with self._cache.pin(path):
            yield self.fetch(sha256)

    def install(self, path: Path, blob: Blob) -> None:
        """Upload a file unless the bucket has it, and keep it in the data directory."""
        if not self._is_young(blob.sha256) and not self._renew(blob.sha256):
            self._upload(blob.sha256, path)
        super().install(path, blob)

    def adopt_object(self, key: str, expected: Blob) -> None:
        """Make an object a blob by a copy within the bucket; nobody else may write to its key.

        Raises
        ------
        FileNotFoundError
            The bucket has no such object.
        WrongContentError
            It has another length or hash.
        """
        size = self._bucket.find_size(key)
        if size != expected.size:
            raise WrongContentError(f"expected {expected.size} bytes, but {size} came")
        with BlobWriter(self.incoming, lambda path, blob: self._install_copy(key, path, blob)) as w:
            for chunk in self._bucket.download(key):
                w.write(chunk)
            if w.written != expected:
                raise WrongContentError(
                    f"expected the SHA-256 {expected.sha256}, but {w.written.sha256} came"
                )
            w.commit()

    def _install_copy(self, key: str, path: Path, blob: Blob) -> None:
        if not self._is_young(blob.sha256) and not self._renew(blob.sha256):
            self._bucket.copy(key, _new_key(blob.sha256))
            self._made_at[blob.sha256] = time.monotonic()
        super().install(path, blob)

    def newest_object(self, sha256: str) -> str:
        """Return the key of the newest instance of a blob.

        Raises
        ------
        FileNotFoundError
            The bucket has none.
        """
        instances = self._instances(sha256)
        if not instances:
            raise FileNotFoundError(sha256)
        return instances[0]

    def touch(self, sha256: str) -> None:
        """Make a new instance of a blob, so that `collect` spares it for the grace time.

        Raises
        ------
        FileNotFoundError
            The blob has been removed.
        """
        if self._is_young(sha256) or self._renew(sha256):
            return
        with self._cache.pin(self.path(sha256)):
            self._upload(sha256, super().fetch(sha256))

    def is_whole(self, sha256: str) -> bool:
        """Return whether an instance of the blob in the bucket has this hash."""
        instances = self._instances(sha256)
        if not instances:
            raise FileNotFoundError(sha256)
        return any(self._read(key, sha256) for key in instances)

    def collect(self, needed: Callable[[], set[str]], *, now: float, grace_s: float) -> int:
        """Remove the files that have not been needed here for the grace time."""
        removed = super().collect(needed, now=now, grace_s=grace_s)
        self._cache.shrink()
        self._forget(time.monotonic() - self._young_s)
        return removed

    def collect_shared(self, needed: Callable[[], set[str]], *, grace_s: float) -> int:
        """Remove the objects of the bucket that have not been needed for the grace time."""
        removable = _find_removable(self._bucket.find_keys(PREFIX), needed())
        seen_at = time.monotonic()
        self._removable_since = {k: self._removable_since.get(k, seen_at) for k in removable}
        over = [k for k, since in self._removable_since.items() if since <= seen_at - grace_s]
        if over:
            self._bucket.delete(over)
        return len(over)

    def _is_young(self, sha256: str) -> bool:
        """Return whether this process has made an instance a moment ago."""
        made_at = self._made_at.get(sha256)
        return made_at is not None and time.monotonic() - made_at < self._young_s

    def _instances(self, sha256: str) -> list[str]:
        """Return the keys of a blob, the newest first."""
        return self._bucket.find_keys(f"{PREFIX}{sha256[:2]}/{sha256}/")[::-1]

    def _renew(self, sha256: str) -> bool:
        """Copy a blob within the bucket; return False where it has none."""
        began_at = time.monotonic()
        for key in self._instances(sha256):
            try:
                self._bucket.copy(key, _new_key(sha256))
            except FileNotFoundError:  # collected meanwhile
                continue
            self._made_at[sha256] = began_at
            return True
        return False

    def _upload(self, sha256: str, path: Path) -> None:
        self._bucket.upload(_new_key(sha256), path)
        self._made_at[sha256] = time.monotonic()

    def _download(self, sha256: str) -> None:
        for key in self._instances(sha256):
            if self._read(key, sha256, keep=True):
                return
        raise FileNotFoundError(f"no whole instance of the blob {sha256}")

    def _read(self, key: str, sha256: str, *, keep: bool = False) -> bool:
        """Read an instance, and keep it here if that is wanted; return whether it is whole."""
        with BlobWriter(self.incoming, super().install) as writer:
            try:
                for chunk in self._bucket.download(key):
                    writer.write(chunk)
            except FileNotFoundError:  # collected meanwhile
                return False
            if writer.written.sha256 != sha256:
                log.error("the object %s of the bucket is damaged", key)
                return False
            if keep:
                writer.commit()
        return True

    def _forget(self, before: float) -> None:
        """Drop the notes of instances that are no longer young."""
        for sha256, made_at in list(self._made_at.items()):
            if made_at < before:
                self._made_at.pop(sha256, None)


def _new_key(sha256: str) -> str:
    """Return the key of a new instance; later ones come later in order, if the clocks agree."""
    return f"{PREFIX}{sha256[:2]}/{sha256}/{time.time_ns():020d}-{secrets.token_hex(4)}"


def _find_removable(keys: list[str], needed: set[str]) -> list[str]:
    """Return the keys of blobs that are not needed, and all but the last one of those that are."""
    instances: defaultdict[str, list[str]] = defaultdict(list)
    for key in sorted(keys):
        instances[key.split("/")[2]].append(key)
    return [
        key
        for sha256, of_blob in instances.items()
        for key in (of_blob[:-1] if sha256 in needed else of_blob)
    ]
