"""What has not changed is not downloaded again."""

from __future__ import annotations

import os

import pytest

from service.outbound import http_cache
from service.outbound.errors import (
    FetchStatusError,
)
from service.outbound.http_cache import Validators, hash_key, prune
from service.storage.blobs import BlobStore
from tests.factories.web import (
    CONTENT,
    Fetch,
    Versioned,
    Web,
)

THEN, NOW = "Mon, 02 Nov 2026 10:00:00 GMT", "Sun, 22 Nov 2026 10:00:00 GMT"


def statuses(web: Web) -> list[bool]:
    """Of each request, whether it was conditional."""
    return [
        "if-none-match" in headers or "if-modified-since" in headers for _, headers in web.requests
    ]


@pytest.mark.parametrize(
    "said",
    [
        {"ETag": '"1"'},
        {"ETag": 'W/"1"'},
        {"Last_Modified": THEN, "Date": NOW},
        {"ETag": '"1"', "Last_Modified": THEN, "Date": NOW},
    ],
)
def test_what_has_not_changed_is_not_sent_again(
    said: dict[str, str], web: Web, fetch: Fetch
) -> None:
    web.behaviours["/file"] = Versioned(**said)
    assert fetch(web.url()) == fetch(web.url())
    assert statuses(web) == [False, True]


def test_what_has_changed_is(web: Web, fetch: Fetch) -> None:
    versioned = web.behaviours["/file"] = Versioned(ETag='"1"')
    fetch(web.url())
    versioned.body, versioned.said = CONTENT[:-1], {"ETag": '"2"'}
    assert fetch(web.url()).size == len(CONTENT) - 1
    assert fetch(web.url()).size == len(CONTENT) - 1
    assert web.requests[2][1]["if-none-match"] == '"2"'


@pytest.mark.parametrize(
    "said",
    [
        {},
        {"ETag": "1"},
        {"ETag": '"\u00e9"'},
        {"ETag": '"' + "1" * 5000 + '"'},
        {"Last_Modified": NOW, "Date": NOW},
        {"Last_Modified": "then", "Date": NOW},
        {"Last_Modified": THEN + " \u00e9", "Date": NOW},
    ],
)
def test_no_condition_without_something_to_rely_on(
    said: dict[str, str], web: Web, fetch: Fetch
) -> None:
    web.behaviours["/file"] = Versioned(**said)
    assert fetch(web.url()) == fetch(web.url())
    assert statuses(web) == [False, False]


def test_a_file_that_was_removed_meanwhile_is_sent_again(
    web: Web, fetch: Fetch, blobs: BlobStore
) -> None:
    web.behaviours["/file"] = Versioned(ETag='"1"')
    blobs.path(fetch(web.url()).sha256).unlink()
    assert blobs.path(fetch(web.url()).sha256).read_bytes() == CONTENT
    assert statuses(web) == [False, False]


def test_neither_tenants_nor_urls_share_what_they_know(web: Web, fetch: Fetch) -> None:
    web.behaviours["/file"] = Versioned(ETag='"1"')
    fetch(web.url(), tenant="a")
    fetch(web.url(), tenant="b")
    fetch(web.url("/file?other"), tenant="a")
    assert statuses(web) == [False, False, False]


def test_the_condition_is_for_the_place_that_the_file_came_from(web: Web, fetch: Fetch) -> None:
    for path, body in (("/1", CONTENT), ("/2", CONTENT[:-1])):
        web.behaviours[path] = versioned = Versioned(ETag='"same"')
        versioned.body = body
    web.behaviours["/latest"] = lambda handler: handler.give(b"", 302, Location="/1")
    fetch(web.url("/latest"))
    web.behaviours["/latest"] = lambda handler: handler.give(b"", 302, Location="/2")
    assert fetch(web.url("/latest")).size == len(CONTENT) - 1
    assert fetch(web.url("/latest")).size == len(CONTENT) - 1
    assert statuses(web) == [False, False, False, False, False, True]


def test_not_modified_unasked_is_an_error(web: Web, fetch: Fetch) -> None:
    web.behaviours["/file"] = lambda handler: handler.head(304)
    with pytest.raises(FetchStatusError):
        fetch(web.url())


def test_what_is_known_of_removed_files_is_forgotten(
    web: Web, fetch: Fetch, blobs: BlobStore
) -> None:
    web.behaviours["/file"] = Versioned(ETag='"1"')
    blob = fetch(web.url("/file?X-Amz-Signature=secret"))
    (said,) = (blobs.root / "fetched").glob("*/*")
    assert "secret" not in said.read_text() + said.name
    prune(blobs.root, blobs)
    assert said.exists()
    blobs.path(blob.sha256).unlink()
    prune(blobs.root, blobs)
    assert not said.exists()


def test_the_entries_of_a_tenant_are_bounded(
    web: Web, fetch: Fetch, blobs: BlobStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Any number of URLs may lead to one file."""
    monkeypatch.setattr(http_cache, "MAX_ENTRIES", 2)
    web.behaviours["/file"] = Versioned(ETag='"1"')
    urls = [web.url(f"/file?{number}") for number in range(4)]
    for age, url in enumerate(reversed(urls)):
        fetch(url)
        (newest,) = (p for p in (blobs.root / "fetched").glob("*/*") if hash_key(url) == p.name)
        os.utime(newest, (age, age))
    prune(blobs.root, blobs)
    kept = {path.name for path in (blobs.root / "fetched").glob("*/*")}
    assert kept == {hash_key(url) for url in urls[:2]}


def test_entries_of_an_earlier_layout_are_removed(blobs: BlobStore) -> None:
    old = blobs.root / "fetched" / "ab"
    old.parent.mkdir()
    old.write_text("{}")
    prune(blobs.root, blobs)
    assert not old.exists()


@pytest.mark.parametrize(
    ("headers", "strong"),
    [
        ({}, None),
        ({"etag": '"1"'}, '"1"'),
        ({"etag": 'W/"1"'}, None),
        ({"last-modified": THEN, "date": NOW}, THEN),
        ({"last-modified": THEN, "date": THEN}, None),
        ({"last-modified": THEN}, None),
        ({"etag": 'W/"1"', "last-modified": THEN, "date": NOW}, None),
    ],
)
def test_a_strong_validator_promises_equal_bytes(
    headers: dict[str, str], strong: str | None
) -> None:
    assert Validators.of(headers).strong == strong
