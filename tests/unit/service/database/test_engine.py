"""Clouds, uploads, keys and what they take up, on each database."""

from __future__ import annotations

from pathlib import Path

import pytest

from service.auth.keys import KeyStore, Limits, split_key
from service.clouds.store import CloudStore
from service.clouds.uploads import UploadStore
from service.database.engine import Database
from service.database.sqlite import SqliteDatabase
from service.jobs.queries import JobFilter, JobQueries
from service.jobs.retention import drop_expired, find_needed_blobs
from service.jobs.usage import count_stored_bytes
from service.problems import InvalidRequestError, UnknownCloudError, UnknownUploadError
from service.storage.blobs import BlobStore

XYZ = b"0 0 0\n1 0 0\n0 1 0\n"


def test_a_cloud_is_its_tenants_own(database: Database, tmp_path: Path) -> None:
    blobs = BlobStore(tmp_path)
    clouds = CloudStore(database, blobs, retention_s=60)
    former = clouds.put("lab", "door", blobs.put([XYZ]))
    cloud = clouds.put("lab", "door", blobs.put([XYZ, XYZ]))
    assert former.sha256 != cloud.sha256
    assert clouds.get("lab", "door") == cloud
    assert clouds.page("lab", limit=9, before=None) == [cloud]
    used = clouds.use("lab", "door")
    assert (used.sha256, used.size) == (cloud.sha256, 2 * len(XYZ))
    assert clouds.get("lab", "door").expires_at > cloud.expires_at
    assert find_needed_blobs(database) == {cloud.sha256}
    with pytest.raises(UnknownCloudError):
        clouds.get("other", "door")
    clouds.remove("lab", "door")
    with pytest.raises(UnknownCloudError):
        clouds.remove("lab", "door")


def test_a_cloud_expires(database: Database, tmp_path: Path) -> None:
    blobs = BlobStore(tmp_path)
    CloudStore(database, blobs, retention_s=-1).put("lab", "door", blobs.put([XYZ]))
    drop_expired(database)
    assert find_needed_blobs(database) == set()


def upload_store(database: Database, root: Path, retention_s: float) -> UploadStore:
    clouds = CloudStore(database, BlobStore(root), retention_s=60)
    return UploadStore(database, clouds, root / "uploads", retention_s=retention_s)


def test_an_upload_may_be_larger_than_32_bits_count(database: Database, tmp_path: Path) -> None:
    uploads = upload_store(database, tmp_path, 60)
    upload = uploads.create("lab", 2**40)
    assert uploads.get("lab", upload.id) == upload
    assert count_stored_bytes(database, "lab") == 2**40
    uploads.remove(upload)
    with pytest.raises(UnknownUploadError):
        uploads.get("lab", upload.id)


def test_uploads_expire_but_not_under_way(database: Database, tmp_path: Path) -> None:
    uploads = upload_store(database, tmp_path, -1)
    upload = uploads.create("lab", 9)
    with uploads.appending(upload, 0) as file:
        upload_store(database, tmp_path, -1).drop_expired()
        file.write(b"x")
    assert uploads.offset(uploads.get("lab", upload.id)) == 1
    uploads.drop_expired()
    assert list((tmp_path / "uploads").iterdir()) == []


def test_an_upload_that_expires_under_a_request_is_unknown_and_leaves_nothing(
    database: Database, tmp_path: Path
) -> None:
    uploads = upload_store(database, tmp_path, -1)
    upload = uploads.create("lab", 9)
    uploads.drop_expired()
    with pytest.raises(UnknownUploadError):
        uploads.offset(upload)
    with pytest.raises(UnknownUploadError), uploads.appending(upload, 0):
        pass
    assert list((tmp_path / "uploads").iterdir()) == []


def test_a_key_is_found_until_it_is_revoked(database: Database) -> None:
    keys = KeyStore(database)
    assert not keys.exist()
    known = split_key(keys.create("lab", "bench", Limits(stored_bytes=2**40)))
    assert known is not None
    key_id, secret = known
    key = keys.find(key_id)
    assert key is not None
    assert key.admits(secret)
    assert not key.admits(secret + "x")
    assert key.limits.stored_bytes == 2**40
    assert keys.exist()
    assert keys.revoke(key_id)
    assert not keys.revoke(key_id)
    revoked = keys.find(key_id)
    assert revoked is not None
    assert not revoked.admits(secret)


def test_text_that_postgresql_cannot_hold_is_the_callers_fault(database: Database) -> None:
    queries = JobQueries(database)
    if isinstance(database, SqliteDatabase):
        assert queries.get("lab", "a\0b") is None
        return
    with pytest.raises(InvalidRequestError):
        queries.get("lab", "a\0b")
    with pytest.raises(InvalidRequestError):
        queries.page("lab", limit=9, only=JobFilter(label=("part", "\0")))
