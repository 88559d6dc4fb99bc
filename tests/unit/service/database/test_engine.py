"""Clouds, uploads, keys and what they take up, on each database."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from service.auth.keys import KeyStore, Limits, split_key
from service.clouds.store import CloudStore
from service.clouds.uploads import UploadStore
from service.database.engine import Database
from service.jobs.listing import Filter
from service.jobs.retention import drop_expired, needed_blobs, stored_bytes
from service.problems import InvalidRequestError, UnknownCloudError, UnknownUploadError
from service.storage.blobs import BlobStore
from tests.unit.service.jobs.test_store import CLOUD, OUTCOME, add, claimed, open_store

XYZ = b"0 0 0\n1 0 0\n0 1 0\n"


@pytest.fixture
def database(url: str) -> Iterator[Database]:
    opened = Database(url)
    yield opened
    opened.close()


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
    assert needed_blobs(database) == {cloud.sha256}
    with pytest.raises(UnknownCloudError):
        clouds.get("other", "door")
    clouds.remove("lab", "door")
    with pytest.raises(UnknownCloudError):
        clouds.remove("lab", "door")


def test_a_cloud_expires(database: Database, tmp_path: Path) -> None:
    blobs = BlobStore(tmp_path)
    CloudStore(database, blobs, retention_s=-1).put("lab", "door", blobs.put([XYZ]))
    drop_expired(database)
    assert needed_blobs(database) == set()


def test_an_upload_may_be_larger_than_32_bits_count(database: Database, tmp_path: Path) -> None:
    uploads = UploadStore(database, tmp_path / "uploads", retention_s=60)
    upload = uploads.create("lab", 2**40)
    assert uploads.get("lab", upload.id) == upload
    assert stored_bytes(database, "lab") == 2**40
    uploads.remove(upload)
    with pytest.raises(UnknownUploadError):
        uploads.get("lab", upload.id)


def test_uploads_expire_but_not_under_way(database: Database, tmp_path: Path) -> None:
    uploads = UploadStore(database, tmp_path / "uploads", retention_s=-1)
    upload = uploads.create("lab", 9)
    with uploads.appending(upload, 0) as file:
        UploadStore(database, tmp_path / "uploads", retention_s=-1).drop_expired()
        file.write(b"x")
    assert uploads.offset(uploads.get("lab", upload.id)) == 1
    uploads.drop_expired()
    assert list((tmp_path / "uploads").iterdir()) == []


def test_an_upload_that_expires_under_a_request_is_unknown_and_leaves_nothing(
    database: Database, tmp_path: Path
) -> None:
    uploads = UploadStore(database, tmp_path / "uploads", retention_s=-1)
    upload = uploads.create("lab", 9)
    uploads.drop_expired()
    with pytest.raises(UnknownUploadError):
        uploads.offset(upload)
    with pytest.raises(UnknownUploadError), uploads.appending(upload, 0):
        pass
    assert list((tmp_path / "uploads").iterdir()) == []


def test_a_file_counts_once_for_its_tenant(database: Database) -> None:
    store = open_store(database)
    add(store), add(store)
    assert CLOUD.size is not None
    assert stored_bytes(database, "lab") == CLOUD.size
    store.succeed(claimed(store), OUTCOME, None)
    assert stored_bytes(database, "lab") == CLOUD.size + OUTCOME.result_bytes
    assert stored_bytes(database, "other") == 0


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
    store = open_store(database)
    if not database.is_shared:
        assert store.get("a\0b") is None
        return
    with pytest.raises(InvalidRequestError):
        store.get("a\0b")
    only = Filter(tenant="lab", label=("part", "\0"))
    with pytest.raises(InvalidRequestError):
        store.page(limit=9, only=only)
