"""Files that were fetched before, so that what has not changed is not downloaded again."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path

from service.outbound.validators import Validators
from service.storage.blobs import Blob, BlobStore


@dataclass(frozen=True, slots=True)
class CachedFile:
    """A stored file, and what its server said of its version."""

    blob: Blob
    validators: Validators


class HttpCache:
    """One small file for each URL and tenant, named by their hash; URLs are not written down."""

    def __init__(self, data_dir: Path, blobs: BlobStore, tenant: str) -> None:
        self._directory = data_dir / "fetched"
        self._blobs = blobs
        self._tenant = tenant
        self._directory.mkdir(exist_ok=True)

    def find(self, name: str) -> CachedFile | None:
        """The file that the URL gave, if it is still stored; it is spared from removal then."""
        try:
            said = json.loads(self._path(name).read_bytes())
            known = CachedFile(Blob(**said["blob"]), Validators(**said["validators"]))
            self._blobs.touch(known.blob.sha256)
        except (FileNotFoundError, ValueError, TypeError, KeyError):
            return None
        return known

    def keep(self, name: str, known: CachedFile) -> None:
        """Remember the file, unless its server said nothing that could be asked for later."""
        path = self._path(name)
        if not known.validators.conditions:
            path.unlink(missing_ok=True)
            return
        draft = self._blobs.incoming / path.name
        draft.write_text(json.dumps(asdict(known)))
        draft.replace(path)

    def _path(self, name: str) -> Path:
        key = hashlib.sha256(json.dumps([self._tenant, name]).encode()).hexdigest()
        return self._directory / key


def prune_http_cache(data_dir: Path, blobs: BlobStore) -> None:
    """Drop what is known of files that are no longer stored."""
    for path in (data_dir / "fetched").glob("*"):
        try:
            sha256 = json.loads(path.read_bytes())["blob"]["sha256"]
        except (FileNotFoundError, ValueError, TypeError, KeyError):
            continue  # removed meanwhile
        if not blobs.path(sha256).exists():
            path.unlink(missing_ok=True)
