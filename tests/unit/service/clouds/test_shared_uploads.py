"""An upload goes on at any service."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from service.clouds.shared_uploads import SharedUploadStore
from service.clouds.store import CloudStore
from service.clouds.uploads import Upload
from service.database.engine import Database
from service.jobs.retention import find_needed_blobs
from service.problems import UploadConflictError
from service.storage.blobs import BlobStore

XYZ = b"0 0 0\n1 0 0\n0 1 0\n"
Open = Callable[[str], SharedUploadStore]


@pytest.fixture
def open_service(database: Database, tmp_path: Path) -> Open:
    """Opens the uploads of a service of this name; the blobs are those of all."""
    blobs = BlobStore(tmp_path)
    clouds = CloudStore(database, blobs, retention_s=60)
    return lambda name: SharedUploadStore(database, clouds, blobs, tmp_path / name, retention_s=60)


def send(uploads: SharedUploadStore, upload: Upload, offset: int, piece: bytes) -> Upload:
    with uploads.open_at(upload, offset) as file:
        file.write(piece)
        file.flush()
        return uploads.finish_piece(upload)


def test_pieces_may_go_to_any_service(
    open_service: Open, database: Database, tmp_path: Path
) -> None:
    first, second = open_service("first"), open_service("second")
    upload = first.create("lab", len(XYZ))
    send(first, upload, 0, XYZ[:5])
    assert second.offset(upload) == 5
    send(second, upload, 5, XYZ[5:9])
    assert len(find_needed_blobs(database)) == 2
    assert send(first, upload, 9, XYZ[9:]).is_complete
    (sha256,) = find_needed_blobs(database)
    assert BlobStore(tmp_path).fetch(sha256).read_bytes() == XYZ
    second.drop_expired()
    assert not list((tmp_path / "second").iterdir())


def test_what_a_killed_service_had_not_stored_is_sent_again(
    open_service: Open, tmp_path: Path
) -> None:
    first = open_service("first")
    upload = first.create("lab", len(XYZ))
    with first.open_at(upload, 0) as file:
        file.write(b"9 9 9")
        file.flush()
        assert first.offset(upload) == 5
    assert first.offset(upload) == 0
    assert send(first, upload, 0, XYZ).is_complete


def test_of_two_services_at_one_offset_one_is_refused(open_service: Open) -> None:
    first, second = open_service("first"), open_service("second")
    upload = first.create("lab", len(XYZ))
    with first.open_at(upload, 0) as file:
        file.write(XYZ[:5])
        file.flush()
        send(second, upload, 0, XYZ[:7])
        with pytest.raises(UploadConflictError):
            first.finish_piece(upload)
    assert first.offset(upload) == 7
    assert send(first, upload, 7, XYZ[7:]).is_complete
