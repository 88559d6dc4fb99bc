"""Machines share a bucket and nothing else."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from service.problems import BlobsUnavailableError
from service.settings import BlobSettings
from service.storage.bucket import PART_BYTES, Bucket
from service.storage.s3_blobs import S3BlobStore
from tests.factories.clock_of_tests import GRACE_S, Clock
from tests.factories.s3 import S3Server, blob_settings, running_s3

Open = Callable[..., S3BlobStore]


def objects(s3: S3Server, settings: BlobSettings) -> list[Path]:
    """Files of the server that hold the objects of a store."""
    prefix = str(settings.url).rpartition("/")[2]
    return [path for path in (s3.bucket / prefix).rglob("*") if path.is_file()]


def collect(store: S3BlobStore, *needed: str) -> None:
    store.collect(lambda: set(needed), now=time.time(), grace_s=GRACE_S)
    store.collect_shared(lambda: set(needed), grace_s=GRACE_S)


def test_another_machine_reads_what_one_has_stored(open_s3: Open) -> None:
    content = os.urandom(PART_BYTES + 1)
    blob = open_s3("here").put([content])
    there = open_s3("there")
    assert there.exists(blob.sha256)
    assert there.fetch(blob.sha256).read_bytes() == content


def test_a_blob_that_is_used_again_and_again_is_downloaded_once(
    open_s3: Open, monkeypatch: pytest.MonkeyPatch
) -> None:
    sha256, there = open_s3("here").put([b"reference"]).sha256, open_s3("there")
    downloads, download = [], Bucket.download
    monkeypatch.setattr(
        Bucket, "download", lambda self, key: downloads.append(key) or download(self, key)
    )
    for _ in range(5):
        with there.hold(sha256) as path:
            assert path.read_bytes() == b"reference"
    assert len(downloads) == 1


def test_a_damaged_object_is_not_delivered(
    open_s3: Open, s3: S3Server, bucket_settings: BlobSettings
) -> None:
    sha256 = open_s3("here").put([b"a cloud"]).sha256
    (stored,) = objects(s3, bucket_settings)
    stored.write_bytes(b"another")
    there = open_s3("there")
    assert not there.is_whole(sha256)
    with pytest.raises(FileNotFoundError):
        there.fetch(sha256)
    assert not list(there.incoming.iterdir())


def test_the_cache_is_bounded_and_keeps_what_is_used(open_s3: Open) -> None:
    here, there = open_s3("here"), open_s3("there", 250)
    old, held, new, last = (here.put([bytes([i]) * 100]).sha256 for i in range(4))
    with there.hold(held):
        for sha256 in (old, new):
            there.fetch(sha256)
        for sha256, age_s in ((held, 900), (old, 800), (new, 700)):
            used_at = time.time() - age_s
            os.utime(there.path(sha256), (used_at, used_at))
        there.fetch(last)
        kept = [there.path(sha256).exists() for sha256 in (old, held, new, last)]
    assert kept == [False, True, False, True]
    assert there.fetch(old).read_bytes() == bytes(100)


def test_a_machine_takes_up_what_another_is_about_to_collect(open_s3: Open, clock: Clock) -> None:
    collecting, sha256 = open_s3("collecting"), open_s3("storing").put([b"a"]).sha256
    taking = open_s3("taking")
    collect(collecting)
    clock.wait(GRACE_S - 1)
    collect(collecting)
    taking.touch(sha256)
    clock.wait(2)
    collect(collecting)
    assert taking.fetch(sha256).read_bytes() == b"a"


def test_of_many_instances_one_stays(
    open_s3: Open, clock: Clock, s3: S3Server, bucket_settings: BlobSettings
) -> None:
    blob = open_s3("first").put([b"a"])
    for machine in ("second", "third"):
        open_s3(machine).touch(blob.sha256)
    assert len(objects(s3, bucket_settings)) == 3
    collectors = open_s3("first"), open_s3("second")
    for _ in range(2):
        for collecting in collectors:
            collect(collecting, blob.sha256)
        clock.wait(GRACE_S + 1)
    assert len(objects(s3, bucket_settings)) == 1
    assert open_s3("fourth").fetch(blob.sha256).read_bytes() == b"a"


def test_while_the_store_is_away_nothing_is_taken_for_missing(tmp_path: Path) -> None:
    with running_s3(tmp_path) as s3:
        bucket = Bucket(blob_settings(s3))
        store = S3BlobStore(tmp_path / "here", bucket, cache_bytes=1 << 20, grace_s=GRACE_S)
        blob = store.put([b"a"])
        s3.kill()
        store.path(blob.sha256).unlink()
        for call in (store.fetch, store.is_whole):
            with pytest.raises(BlobsUnavailableError):
                call(blob.sha256)
        with pytest.raises(BlobsUnavailableError):
            store.put([b"b"])
        s3.start()
        assert store.fetch(blob.sha256).read_bytes() == b"a"
