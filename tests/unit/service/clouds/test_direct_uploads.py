"""What arrives in the bucket directly is a cloud only if it is what was announced."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import httpx
import pytest

from service.clouds.direct_uploads import PREFIX, DirectUploads, require_direct
from service.clouds.store import CloudStore
from service.database.engine import Database, open_database
from service.formats import UnknownFormatError
from service.problems import (
    InvalidRequestError,
    NoDirectTransferError,
    UnknownCloudError,
    UnknownUploadError,
    UploadConflictError,
)
from service.storage.blobs import Blob
from service.storage.bucket import Bucket
from service.storage.s3_blobs import S3BlobStore
from tests.factories.clock_of_tests import CACHE_BYTES, GRACE_S
from tests.factories.s3 import S3Server, blob_settings

XYZ = b"0 0 0\n1 0 0\n0 1 0\n"
FILE = Blob(hashlib.sha256(XYZ).hexdigest(), len(XYZ))


@pytest.fixture
def bucket(s3: S3Server) -> Bucket:
    given = blob_settings(s3)
    return Bucket(given.model_copy(update={"public_endpoint": given.endpoint}))


@pytest.fixture
def database(tmp_path: Path) -> Iterator[Database]:
    with closing(open_database(f"sqlite:///{tmp_path / 'jobs.sqlite3'}")) as opened:
        yield opened


@pytest.fixture
def direct(database: Database, bucket: Bucket, tmp_path: Path) -> DirectUploads:
    blobs = S3BlobStore(tmp_path, bucket, cache_bytes=CACHE_BYTES, grace_s=GRACE_S)
    clouds = CloudStore(database, blobs, retention_s=60)
    return DirectUploads(database, clouds, bucket, blobs, retention_s=60)


def send(url: str, content: bytes) -> None:
    assert httpx.put(url, content=content, trust_env=False).is_success


def test_a_file_becomes_a_cloud_and_is_fetched_by_a_signed_url(
    direct: DirectUploads, bucket: Bucket
) -> None:
    upload, url = direct.create("lab", FILE)
    with pytest.raises(UploadConflictError, match="has not arrived"):
        direct.complete(upload)
    send(url, XYZ)
    cloud = direct.complete(direct.get("lab", upload.id))
    assert (cloud.id, cloud.sha256, cloud.size) == (upload.id, FILE.sha256, FILE.size)
    assert direct.complete(direct.get("lab", upload.id)) == cloud
    assert not bucket.find_keys(PREFIX)
    assert httpx.get(direct.sign_download(FILE.sha256), trust_env=False).content == XYZ


@pytest.mark.parametrize(
    ("content", "words"),
    [(XYZ.replace(b"1", b"2"), "SHA-256"), (XYZ + b"1 1 1\n", f"expected {len(XYZ)} bytes")],
)
def test_another_file_than_announced_is_refused_and_removed(
    direct: DirectUploads, bucket: Bucket, content: bytes, words: str
) -> None:
    upload, url = direct.create("lab", FILE)
    send(url, content)
    with pytest.raises(InvalidRequestError, match=words):
        direct.complete(upload)
    with pytest.raises(UnknownUploadError):
        direct.get("lab", upload.id)
    direct.collect()
    assert not bucket.find_keys(PREFIX)
    assert not bucket.find_keys("blobs/")


def test_what_is_no_cloud_is_refused(direct: DirectUploads) -> None:
    content = bytes(100)
    upload, url = direct.create("lab", Blob(hashlib.sha256(content).hexdigest(), 100))
    send(url, content)
    with pytest.raises(UnknownFormatError):
        direct.complete(upload)


def test_clean_up_keeps_what_is_awaited_and_removes_what_is_too_long(
    direct: DirectUploads, bucket: Bucket
) -> None:
    (_, good), (_, bad) = direct.create("lab", FILE), direct.create("lab", FILE)
    send(good, XYZ)
    send(bad, bytes(1000))
    direct.collect()
    assert list(bucket.find_sizes(PREFIX).values()) == [len(XYZ)]


def test_other_tenants_see_no_upload(direct: DirectUploads) -> None:
    upload, url = direct.create("lab", FILE)
    send(url, XYZ)
    with pytest.raises(UnknownUploadError):
        direct.get("field", upload.id)
    direct.complete(upload)
    with pytest.raises(UnknownCloudError):
        direct._clouds.get("field", upload.id)


def test_without_a_public_store_another_way_is_named() -> None:
    with pytest.raises(NoDirectTransferError, match="POST /v1/uploads"):
        require_direct(None)
