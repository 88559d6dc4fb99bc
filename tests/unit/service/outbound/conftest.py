"""A web server for each test, and names that lead to it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from service.outbound.client import OutboundClient
from service.outbound.deadline import TransferLimits
from service.outbound.download import Download
from service.outbound.http_cache import HttpCache
from service.outbound.url_policy import UrlPolicy
from service.outbound.urls import parse_url
from service.storage.blobs import Blob, BlobStore
from tests.factories.web import OPEN, Names, Web, serving

Fetch = Callable[..., Blob]


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
        rules: UrlPolicy = OPEN,
        *,
        tenant: str = "",
        max_bytes: int = 10**6,
        total_s: float = 60,
        stall_s: float = 30,
        min_bytes_s: float = 0,
        tls: object = None,
    ) -> Blob:
        known = HttpCache(tmp_path, blobs, tenant)
        bounds = TransferLimits(total_s, stall_s, min_bytes_s)
        door = OutboundClient(rules, resolve=names, tls=tls)
        return Download(door, blobs, known, bounds=bounds, max_bytes=max_bytes).run(parse_url(url))

    return fetched
