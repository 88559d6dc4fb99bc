"""Cache of downloaded files by URL, revalidated with the server at each use."""

from __future__ import annotations

import hashlib
import json
import re
import secrets
from dataclasses import asdict, dataclass
from email.utils import parsedate_to_datetime
from pathlib import Path
from typing import Self

from service.storage.blobs import Blob, BlobStore, blob_path

DIRECTORY = "fetched"
MAX_ENTRIES = 1000
"""Entries of a tenant that outlast the clean-up, the youngest ones: any number of URLs may have the
same content, which is stored once."""
MAX_VALIDATOR_LENGTH = 260
"""Characters of an ETag or a date that is used; longer ones count as none."""
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
        if modified is not None and len(modified) > MAX_VALIDATOR_LENGTH:
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


def hash_key(url: str) -> str:
    """Return the key of a URL: its SHA-256, because URLs may hold credentials."""
    return hashlib.sha256(url.encode()).hexdigest()


class HttpCache:
    """Files of one tenant by URL: each entry is a small file named by its key, see `hash_key`.

    The process that fetches reads it; the service process writes it.
    """

    def __init__(self, data_dir: Path, tenant: str) -> None:
        self._data_dir = data_dir
        self.directory = data_dir / DIRECTORY / hashlib.sha256(tenant.encode()).hexdigest()

    def find(self, key: str) -> CachedFile | None:
        """Return the file cached under a key, if it is still stored."""
        try:
            entry = json.loads((self.directory / key).read_bytes())
            cached = CachedFile(Blob(**entry["blob"]), Validators(**entry["validators"]))
        except (OSError, ValueError, TypeError, KeyError):
            return None
        return cached if blob_path(self._data_dir, cached.blob.sha256).exists() else None

    def store(self, key: str, cached: CachedFile) -> None:
        """Cache a file under a key; without validators it cannot be, and the key is dropped."""
        path = self.directory / key
        if not cached.validators.conditions:
            path.unlink(missing_ok=True)
            return
        self.directory.mkdir(parents=True, exist_ok=True)
        draft = self._data_dir / "incoming" / f"{key}-{secrets.token_hex(4)}"
        draft.write_text(json.dumps(asdict(cached)))
        draft.replace(path)


def prune(data_dir: Path, blobs: BlobStore) -> None:
    """Remove the entries, of all tenants, whose file is no longer stored, and the oldest ones."""
    for folder in (data_dir / DIRECTORY).glob("*"):
        if folder.is_file():  # an entry in the layout of an earlier build
            folder.unlink(missing_ok=True)
            continue
        kept: list[tuple[float, Path]] = []
        for path in folder.glob("*"):
            try:
                sha256 = json.loads(path.read_bytes())["blob"]["sha256"]
                kept.append((path.stat().st_mtime, path))
            except (FileNotFoundError, ValueError, TypeError, KeyError):
                continue  # replaced or removed meanwhile
            if not blobs.path(sha256).exists():
                path.unlink(missing_ok=True)
        for _, path in sorted(kept)[:-MAX_ENTRIES]:
            path.unlink(missing_ok=True)
