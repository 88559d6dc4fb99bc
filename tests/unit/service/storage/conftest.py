"""Stores of blobs: in a directory, and in a bucket of a real S3 server."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from service.settings import BlobSettings
from service.storage.bucket import Bucket
from service.storage.s3_blobs import S3BlobStore
from tests.factories.clock_of_tests import CACHE_BYTES, GRACE_S, Clock
from tests.factories.s3 import S3Server, blob_settings


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    passing = SimpleNamespace(
        monotonic=lambda: time.monotonic() + clock.waited_s, time_ns=time.time_ns
    )
    monkeypatch.setattr("service.storage.s3_blobs.time", passing)
    return clock


@pytest.fixture
def bucket_settings(s3: S3Server) -> BlobSettings:
    """Settings of an empty part of a bucket."""
    return blob_settings(s3)


@pytest.fixture
def open_s3(bucket_settings: BlobSettings, tmp_path: Path) -> Callable[..., S3BlobStore]:
    """Opens the store of one bucket, each time in a data directory of its own."""

    def open_one(machine: str = "here", cache_bytes: int = CACHE_BYTES) -> S3BlobStore:
        bucket = Bucket(bucket_settings)
        return S3BlobStore(tmp_path / machine, bucket, cache_bytes=cache_bytes, grace_s=GRACE_S)

    return open_one
