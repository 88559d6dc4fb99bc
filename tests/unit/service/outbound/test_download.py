"""Nothing is downloaded twice: what has not changed, and what came before a cut."""

from __future__ import annotations

import hashlib

import pytest

from service.outbound.errors import FetchCutError, FetchStatusError, FetchTooLargeError
from service.outbound.http_cache import prune
from service.storage.blobs import BlobStore
from tests.factories.web import CONTENT, Fetch, Handler, Names, Web

SHA256 = hashlib.sha256(CONTENT).hexdigest()
THEN, NOW = "Mon, 02 Nov 2026 10:00:00 GMT", "Sun, 22 Nov 2026 10:00:00 GMT"
HALF = len(CONTENT) // 2


class Versioned:
    """A file of a server that knows conditional requests."""

    def __init__(self, **said: str) -> None:
        self.body = CONTENT
        self.said = said

    def __call__(self, handler: Handler) -> None:
        etag = self.said.get("ETag")
        same = (etag is not None and handler.headers.get("If-None-Match") == etag) or (
            "Last_Modified" in self.said
            and handler.headers.get("If-Modified-Since") == self.said["Last_Modified"]
        )
        if same:
            handler.head(304, **self.said)
        else:
            handler.give(self.body, **self.said)


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
    (said,) = (blobs.root / "fetched").iterdir()
    assert "secret" not in said.read_text() + said.name
    prune(blobs.root, blobs)
    assert said.exists()
    blobs.path(blob.sha256).unlink()
    prune(blobs.root, blobs)
    assert not said.exists()


class Cut:
    """Ends the connection after each `step` bytes; heeds Range and If-Range as told."""

    def __init__(self, step: int, *, etag: str | None = '"1"', heeds_if_range: bool = True) -> None:
        self.step = step
        self.etag = etag
        self.heeds_if_range = heeds_if_range

    def __call__(self, handler: Handler) -> None:
        said = {} if self.etag is None else {"ETag": self.etag}
        wanted = handler.headers.get("Range")
        same = handler.headers.get("If-Range") == self.etag or not self.heeds_if_range
        if wanted is None or not same:
            handler.give_part(0, self.step, **said)
            return
        start = int(wanted.removeprefix("bytes=").removesuffix("-"))
        said["Content-Range"] = f"bytes {start}-{len(CONTENT) - 1}/{len(CONTENT)}"
        handler.give_part(start, start + self.step, 206, **said)


def ranges(web: Web) -> list[str | None]:
    return [headers.get("range") for _, headers in web.requests]


def test_a_cut_file_is_taken_up_where_it_was_cut(web: Web, fetch: Fetch, blobs: BlobStore) -> None:
    web.behaviours["/file"] = Cut(HALF)
    blob = fetch(web.url())
    assert blob.sha256 == SHA256
    assert blobs.path(SHA256).read_bytes() == CONTENT
    assert ranges(web) == [None, f"bytes={HALF}-"]
    assert web.requests[1][1]["if-range"] == '"1"'


def test_a_file_that_changed_meanwhile_begins_again(web: Web, fetch: Fetch) -> None:
    def changed(handler: Handler) -> None:
        first = len(web.requests) == 1
        Cut(HALF, etag='"1"')(handler) if first else Versioned(ETag='"2"')(handler)

    web.behaviours["/file"] = changed
    assert fetch(web.url()).sha256 == SHA256
    assert ranges(web) == [None, f"bytes={HALF}-"]


def test_a_changed_file_of_a_server_that_does_not_heed_if_range_begins_again(
    web: Web, fetch: Fetch
) -> None:
    def changed(handler: Handler) -> None:
        count = len(web.requests)
        if count == 1:
            Cut(HALF, etag='"1"')(handler)
        elif count == 2:
            Cut(HALF, etag='"2"', heeds_if_range=False)(handler)
        else:
            Versioned(ETag='"2"')(handler)

    web.behaviours["/file"] = changed
    assert fetch(web.url()).sha256 == SHA256
    assert ranges(web) == [None, f"bytes={HALF}-", None]


@pytest.mark.parametrize("etag", [None, 'W/"1"'])
def test_without_a_strong_validator_it_begins_again(
    etag: str | None, web: Web, fetch: Fetch
) -> None:
    def cut_once(handler: Handler) -> None:
        Cut(HALF if len(web.requests) == 1 else len(CONTENT), etag=etag)(handler)

    web.behaviours["/file"] = cut_once
    assert fetch(web.url()).sha256 == SHA256
    assert ranges(web) == [None, None]


def test_a_redirect_that_leads_elsewhere_meanwhile_begins_again(web: Web, fetch: Fetch) -> None:
    web.behaviours["/1"] = Cut(HALF)
    web.behaviours["/2"] = Cut(len(CONTENT))
    web.behaviours["/latest"] = lambda handler: handler.give(
        b"", 302, Location="/1" if len(web.requests) == 1 else "/2"
    )
    assert fetch(web.url("/latest")).sha256 == SHA256
    assert ranges(web) == [None, None, None, None]


def test_a_part_that_does_not_fit_is_not_put_together(web: Web, fetch: Fetch) -> None:
    def odd(handler: Handler) -> None:
        if "Range" in handler.headers:
            said = {"Content-Range": f"bytes 0-9/{len(CONTENT)}", "ETag": '"1"'}
            handler.give(CONTENT[:10], 206, **said)
        else:
            Cut(HALF if len(web.requests) == 1 else len(CONTENT))(handler)

    web.behaviours["/file"] = odd
    assert fetch(web.url()).sha256 == SHA256
    assert ranges(web) == [None, f"bytes={HALF}-", None]


def test_a_range_that_cannot_be_had_begins_again(web: Web, fetch: Fetch) -> None:
    def odd(handler: Handler) -> None:
        if "Range" in handler.headers:
            handler.give(b"", 416)
        else:
            Cut(HALF if len(web.requests) == 1 else len(CONTENT))(handler)

    web.behaviours["/file"] = odd
    assert fetch(web.url()).sha256 == SHA256


def test_a_rest_that_is_announced_too_large_is_not_read(web: Web, fetch: Fetch) -> None:
    def grown(handler: Handler) -> None:
        if "Range" in handler.headers:
            said = {"Content-Range": f"bytes {HALF}-999999999/1000000000", "ETag": '"1"'}
            handler.give(b"x", 206, **said)
        else:
            Cut(HALF)(handler)

    web.behaviours["/file"] = grown
    with pytest.raises(FetchTooLargeError):
        fetch(web.url())


def test_a_server_that_cuts_and_cuts_is_given_up(web: Web, fetch: Fetch, blobs: BlobStore) -> None:
    web.behaviours["/file"] = Cut(1000)
    with pytest.raises(FetchCutError):
        fetch(web.url())
    assert ranges(web) == [None, *(f"bytes={1000 * n}-" for n in range(1, 5))]
    assert not list(blobs.incoming.iterdir())


def test_a_server_that_comes_back_is_taken_up_again(web: Web, fetch: Fetch, names: Names) -> None:
    web.behaviours["/file"] = Cut(HALF)
    names.turns["files.example"] = [["127.0.0.1"], ["127.0.0.4"], ["127.0.0.1"]]
    assert fetch(web.url()).sha256 == SHA256
    assert ranges(web) == [None, f"bytes={HALF}-"]
