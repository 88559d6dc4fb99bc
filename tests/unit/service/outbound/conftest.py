"""A web server for each test, and names that lead to it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
import trustme

from service.outbound.client import OutboundClient
from service.outbound.deadline import TransferLimits
from service.outbound.download import download
from service.outbound.http_cache import CachedFile, HttpCache
from service.outbound.url_policy import UrlPolicy
from service.outbound.urls import parse_url
from service.storage.blobs import Blob, BlobStore
from tests.factories.web import OPEN, Fetch, Names, Web, serving


@pytest.fixture(scope="session")
def authority() -> trustme.CA:
    """Whom the TLS servers of the tests are certified by."""
    return trustme.CA()


@pytest.fixture
def web() -> Iterator[Web]:
    with serving() as running:
        yield running


@pytest.fixture
def names() -> Names:
    return Names()


@pytest.fixture
def blobs(tmp_path: Path) -> BlobStore:
    return BlobStore(tmp_path)


@pytest.fixture
def fetch(blobs: BlobStore, names: Names, tmp_path: Path) -> Fetch:
    """Downloads as the service does, with names and bounds of the tests' own."""

    def fetched(
        url: str,
        policy: UrlPolicy = OPEN,
        *,
        tenant: str = "",
        max_bytes: int = 10**6,
        total_s: float = 60,
        read_timeout_s: float = 30,
        min_bytes_per_s: float = 0,
        tls: object = None,
    ) -> Blob:
        limits = TransferLimits(total_s, read_timeout_s, min_bytes_per_s)
        client = OutboundClient(policy, resolve=names, tls=tls)
        cache, output = HttpCache(tmp_path, tenant), tmp_path / "output"
        done = download(client, parse_url(url), output, cache, limits=limits, max_bytes=max_bytes)
        if done.is_cached:
            cached = cache.find(done.key)
            assert cached is not None
            return cached.blob
        blob = blobs.adopt(output)
        cache.store(done.key, CachedFile(blob, done.validators))
        return blob

    return fetched
