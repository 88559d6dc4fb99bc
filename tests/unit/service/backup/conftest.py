"""A data directory with a store, a job whose result is kept, a cloud, and an upload in pieces."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from service.clouds.inputs import CloudInput
from service.clouds.store import CloudStore
from service.clouds.uploads import UploadStore
from service.database.engine import Database
from service.database.store import open_store
from service.settings import Settings
from service.storage.blobs import BlobStore
from tests.factories.jobs import add, open_transitions

CONTENT = b"0 0 0\n1 0 0\n0 1 0\n"


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    """Settings of a data directory that is in use."""
    settings = Settings(data_dir=tmp_path / "data")
    with closing(open_store(settings)) as database:
        fill(settings, database)
    return settings


def fill(settings: Settings, database: Database) -> None:
    blobs = BlobStore(settings.data_dir)
    clouds = CloudStore(database, blobs, retention_s=1e6)
    uploads = UploadStore(database, clouds, settings.data_dir / "uploads", retention_s=1e6)
    clouds.put("lab", "door", blobs.put([CONTENT]))
    blob = blobs.put([b"other"])
    source = CloudInput(blob.sha256, blob.size)
    add(open_transitions(database), source=source, target=source)
    upload = uploads.create("lab", 100)
    with uploads.open_at(upload, 0) as file:
        file.write(CONTENT)
    blobs.put([b"needed by nobody"])


@pytest.fixture
def blob_of() -> Callable[[Path, bytes], Path]:
    """The path of the blob with a content, in a data directory or a backup."""

    def find(directory: Path, content: bytes) -> Path:
        return next(path for path in directory.glob("blobs/*/*") if path.read_bytes() == content)

    return find
