"""Cache of downloaded files by URL, revalidated with the server at each use."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import asdict, dataclass
from email.utils import parsedate_to_datetime
from pathlib import Path
from typing import Self

from service.storage.blobs import Blob, BlobStore

DIRECTORY = "fetched"
_ETAG = re.compile(r'(?:W/)?"[!#-~]{0,256}"')


@dataclass(frozen=True, slots=True)
class Validators:
    """ETag and Last-Modified of one version of a file (RFC 9110, section 8.8), if valid."""

    etag: str | None = None
    last_modified: str | None = None

    @classmethod
    def of(cls, headers: dict[str, str]) -> Self:
        """Read the validators of a response; names of headers in lower case."""
        etag, modified = headers.get("etag"), headers.get("last-modified")
        if etag is not None and not _ETAG.fullmatch(etag):
            etag = None
        if modified is not None and not _is_strong(modified, headers.get("date")):
            modified = None
        return cls(etag, modified)

    @property
    def conditions(self) -> dict[str, str]:
        """Headers that ask for the file only if it has changed; empty without validators."""
        if self.etag is not None:
            return {"If-None-Match": self.etag}
        if self.last_modified is not None:
            return {"If-Modified-Since": self.last_modified}
        return {}

    @property
    def strong(self) -> str | None:
        """The validator that guarantees identical bytes (header If-Range), or None."""
        if self.etag is not None:
            return None if self.etag.startswith("W/") else self.etag
        return self.last_modified


def _is_strong(modified: str, date: str | None) -> bool:
    """Tell whether the response is at least 1 s newer than the file's last change.

    Within that second the file can change again under the same Last-Modified.
    """
    if date is None:
        return False
    try:
        age = parsedate_to_datetime(date) - parsedate_to_datetime(modified)
        return modified.isascii() and age.total_seconds() >= 1
    except (ValueError, TypeError):
        return False


@dataclass(frozen=True, slots=True)
class CachedFile:
    """A stored file and the validators that its server sent."""

    blob: Blob
    validators: Validators


class HttpCache:
    """Files of one tenant by URL.

    Each entry is a small file named by the hash of tenant and URL: URLs, which may hold
    credentials, are not written down.
    """

    def __init__(self, data_dir: Path, blobs: BlobStore, tenant: str) -> None:
        self._directory = data_dir / DIRECTORY
        self._blobs = blobs
        self._tenant = tenant
        self._directory.mkdir(exist_ok=True)

    def find(self, key: str) -> CachedFile | None:
        """Return the file cached under a key, if it is still stored, and protect it for now."""
        try:
            entry = json.loads(self._path(key).read_bytes())
            cached = CachedFile(Blob(**entry["blob"]), Validators(**entry["validators"]))
            self._blobs.touch(cached.blob.sha256)
        except (FileNotFoundError, ValueError, TypeError, KeyError):
            return None
        return cached

    def store(self, key: str, cached: CachedFile) -> None:
        """Cache a file under a key; without validators it cannot be, and the key is dropped."""
        path = self._path(key)
        if not cached.validators.conditions:
            path.unlink(missing_ok=True)
            return
        draft = self._blobs.incoming / path.name
        draft.write_text(json.dumps(asdict(cached)))
        draft.replace(path)

    def _path(self, key: str) -> Path:
        name = hashlib.sha256(json.dumps([self._tenant, key]).encode()).hexdigest()
        return self._directory / name


def prune(data_dir: Path, blobs: BlobStore) -> None:
    """Remove the entries, of all tenants, whose file is no longer stored."""
    for path in (data_dir / DIRECTORY).glob("*"):
        try:
            sha256 = json.loads(path.read_bytes())["blob"]["sha256"]
        except (FileNotFoundError, ValueError, TypeError, KeyError):
            continue  # replaced or removed meanwhile
        if not blobs.path(sha256).exists():
            path.unlink(missing_ok=True)
