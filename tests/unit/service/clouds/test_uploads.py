"""Uploads: pieces in order, completion, expiry."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from service.clouds.shared_uploads import SharedUploadStore
from service.clouds.store import CloudStore
from service.clouds.uploads import Upload, UploadStore
from service.database.engine import Database
from service.formats import UnknownFormatError
from service.jobs.usage import ROW_BYTES, count_stored_bytes
from service.problems import (
    NotReadyError,
    UnknownCloudError,
    UnknownUploadError,
    UploadConflictError,
)
from service.storage.blobs import BlobStore

XYZ = b"0 0 0\n1 0 0\n0 1 0\n"
Open = Callable[..., UploadStore]


@pytest.fixture
def clouds(database: Database, tmp_path: Path) -> CloudStore:
    return CloudStore(database, BlobStore(tmp_path), retention_s=60)


@pytest.fixture(params=["files", "blobs"])
def open_uploads(
    request: pytest.FixtureRequest, database: Database, clouds: CloudStore, tmp_path: Path
) -> Open:
    """Opens the uploads of one service, with their pieces in its file or as blobs of all."""

    def open_(*, retention_s: float = 60) -> UploadStore:
        directory = tmp_path / "uploads"
        if request.param == "files":
            return UploadStore(database, clouds, directory, retention_s=retention_s)
        blobs = BlobStore(tmp_path)
        return SharedUploadStore(database, clouds, blobs, directory, retention_s=retention_s)

    return open_


def send(uploads: UploadStore, upload: Upload, offset: int, piece: bytes) -> Upload:
    """Append a piece as the API does."""
    with uploads.open_at(upload, offset) as file:
        file.write(piece)
        file.flush()
        return uploads.finish_piece(upload)


def files(tmp_path: Path) -> list[Path]:
    return list((tmp_path / "uploads").iterdir())


def test_a_complete_upload_is_the_cloud_of_its_id(
    open_uploads: Open, clouds: CloudStore, tmp_path: Path
) -> None:
    uploads = open_uploads()
    upload = send(uploads, uploads.create("lab", len(XYZ)), 0, XYZ[:7])
    assert not upload.is_complete
    assert uploads.offset(upload) == 7
    with pytest.raises(UnknownCloudError):
        clouds.get("lab", upload.id)
    upload = send(uploads, upload, 7, XYZ[7:])
    assert upload.is_complete
    assert uploads.offset(upload) == len(XYZ)
    assert clouds.get("lab", upload.id).size == len(XYZ)
    assert files(tmp_path) == []


def test_a_piece_begins_where_the_last_one_ended(open_uploads: Open) -> None:
    uploads = open_uploads()
    upload = send(uploads, uploads.create("lab", len(XYZ)), 0, XYZ[:7])
    for offset in (0, 6, 8):
        with pytest.raises(UploadConflictError, match="must be 7,"):
            send(uploads, upload, offset, XYZ[offset:])
    upload = send(uploads, upload, 7, XYZ[7:])
    with pytest.raises(UploadConflictError, match=f"must be {len(XYZ)},"):
        send(uploads, upload, 7, b"")


def test_one_request_appends_at_a_time(open_uploads: Open) -> None:
    uploads = open_uploads()
    upload = uploads.create("lab", len(XYZ))
    with (
        uploads.open_at(upload, 0),
        pytest.raises(UploadConflictError, match="Another"),
        uploads.open_at(upload, 0),
    ):
        pass
    send(uploads, upload, 0, XYZ)


def test_a_complete_upload_that_is_no_cloud_is_removed(open_uploads: Open, tmp_path: Path) -> None:
    uploads = open_uploads()
    upload = uploads.create("lab", 3)
    with pytest.raises(UnknownFormatError):
        send(uploads, upload, 0, b"\0\1\2")
    with pytest.raises(UnknownUploadError):
        uploads.get("lab", upload.id)
    assert files(tmp_path) == []


def test_an_upload_may_be_larger_than_32_bits_count(open_uploads: Open, database: Database) -> None:
    uploads = open_uploads()
    upload = uploads.create("lab", 2**40)
    assert uploads.get("lab", upload.id) == upload
    with pytest.raises(UnknownUploadError):
        uploads.get("other", upload.id)
    assert count_stored_bytes(database, "lab") == 2**40 + ROW_BYTES
    uploads.remove(upload)
    with pytest.raises(UnknownUploadError):
        uploads.get("lab", upload.id)


def test_uploads_expire_but_not_under_way(open_uploads: Open, tmp_path: Path) -> None:
    uploads = open_uploads(retention_s=-1)
    upload = uploads.create("lab", 9)
    with uploads.open_at(upload, 0) as file:
        open_uploads().drop_expired()
        file.write(b"x")
        file.flush()
        uploads.finish_piece(upload)
    assert uploads.offset(uploads.get("lab", upload.id)) == 1
    uploads.drop_expired()
    assert files(tmp_path) == []


def test_a_complete_upload_expires_and_its_cloud_stays(
    open_uploads: Open, clouds: CloudStore
) -> None:
    uploads = open_uploads(retention_s=-1)
    upload = send(uploads, uploads.create("lab", len(XYZ)), 0, XYZ)
    uploads.drop_expired()
    with pytest.raises(UnknownUploadError):
        uploads.get("lab", upload.id)
    assert clouds.get("lab", upload.id).id == upload.id


def test_an_upload_that_expires_under_a_request_is_unknown_and_leaves_nothing(
    open_uploads: Open, tmp_path: Path
) -> None:
    uploads = open_uploads(retention_s=-1)
    upload = uploads.create("lab", 9)
    uploads.drop_expired()
    with pytest.raises(UnknownUploadError):
        uploads.offset(upload)
    with pytest.raises(UnknownUploadError), uploads.open_at(upload, 0):
        pass
    assert files(tmp_path) == []


def test_a_full_disk_gets_the_bytes_back_before_the_row(
    open_uploads: Open, database: Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    uploads = open_uploads(retention_s=-1)
    upload = send(uploads, uploads.create("lab", 9), 0, b"1 2 3")

    def refuse(**_: object) -> None:
        raise NotReadyError("the disk is full")

    with monkeypatch.context() as full:
        full.setattr(database, "write", refuse)
        for remove in (lambda: uploads.remove(upload), uploads.drop_expired):
            with pytest.raises(NotReadyError):
                remove()
            assert files(tmp_path) == []
    uploads.drop_expired()
    with pytest.raises(UnknownUploadError):
        uploads.get("lab", upload.id)
