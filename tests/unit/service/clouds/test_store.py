"""Stored clouds: whose they are, how long they live, which format they have."""

from __future__ import annotations

from pathlib import Path

import pytest

from service.clouds.store import CloudStore
from service.database.engine import Database
from service.formats import UnknownFormatError
from service.jobs.retention import drop_expired, find_needed_blobs
from service.problems import ExpiredError, InvalidRequestError, UnknownCloudError
from service.storage.blobs import BlobStore

XYZ = b"0 0 0\n1 0 0\n0 1 0\n"


@pytest.fixture
def blobs(tmp_path: Path) -> BlobStore:
    return BlobStore(tmp_path)


@pytest.fixture
def clouds(database: Database, blobs: BlobStore) -> CloudStore:
    return CloudStore(database, blobs, retention_s=60)


def test_a_cloud_is_its_tenants_own(
    clouds: CloudStore, blobs: BlobStore, database: Database
) -> None:
    former = clouds.put("lab", "door", blobs.put([XYZ]))
    cloud = clouds.put("lab", "door", blobs.put([XYZ, XYZ]))
    assert former.sha256 != cloud.sha256
    assert clouds.get("lab", "door") == cloud
    assert clouds.page("lab", limit=9, before=None) == [cloud]
    assert clouds.page("other", limit=9, before=None) == []
    assert find_needed_blobs(database) == {cloud.sha256}
    for call in (clouds.get, clouds.use, clouds.remove):
        with pytest.raises(UnknownCloudError):
            call("other", "door")
    clouds.remove("lab", "door")
    with pytest.raises(UnknownCloudError):
        clouds.remove("lab", "door")


def test_a_cloud_that_is_used_lives_longer(clouds: CloudStore, blobs: BlobStore) -> None:
    cloud = clouds.put("lab", "door", blobs.put([XYZ]))
    used = clouds.use("lab", "door")
    assert (used.sha256, used.size, used.cloud) == (cloud.sha256, len(XYZ), "door")
    assert clouds.get("lab", "door").expires_at > cloud.expires_at


def test_a_cloud_expires(database: Database, blobs: BlobStore) -> None:
    CloudStore(database, blobs, retention_s=-1).put("lab", "door", blobs.put([XYZ]))
    drop_expired(database)
    assert find_needed_blobs(database) == set()


def test_a_declared_format_is_passed_on_to_the_reader(clouds: CloudStore, blobs: BlobStore) -> None:
    content = bytes(16)
    cloud = clouds.put("lab", "scan", blobs.put([content]), "kitti")
    assert (cloud.format, cloud.declared) == ("kitti", True)
    assert clouds.use("lab", "scan").reading == {"format": "kitti"}
    clouds.put("lab", "door", blobs.put([XYZ]))
    assert clouds.use("lab", "door").reading == {}


def test_a_file_that_is_no_cloud_is_refused(clouds: CloudStore, blobs: BlobStore) -> None:
    with pytest.raises(InvalidRequestError, match="cloud: the file is empty"):
        clouds.put("lab", "door", blobs.put([b""]))
    with pytest.raises(UnknownFormatError, match=r"cloud: .*none of the formats"):
        clouds.put("lab", "door", blobs.put([b"\0\1\2"]))
    with pytest.raises(UnknownCloudError):
        clouds.get("lab", "door")


def test_a_cloud_whose_file_is_missing_has_to_be_stored_again(
    clouds: CloudStore, blobs: BlobStore
) -> None:
    cloud = clouds.put("lab", "door", blobs.put([XYZ]))
    blobs.path(cloud.sha256).unlink()
    with pytest.raises(ExpiredError, match="store the cloud again"):
        clouds.use("lab", "door")
    clouds.put("lab", "door", blobs.put([XYZ]))
    assert clouds.use("lab", "door").sha256 == cloud.sha256
