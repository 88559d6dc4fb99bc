"""A file on its way to the store: bounded, checked, and continued where it was cut."""

from __future__ import annotations

import gzip

import pytest

from service.outbound.client import OutboundResponse
from service.outbound.download import Action, PartialFile, announced_size, choose_action
from service.outbound.errors import (
    FetchCutError,
    FetchError,
    FetchStatusError,
    FetchTooLargeError,
)
from service.outbound.urls import Url, parse_url
from service.storage.blobs import BlobStore
from tests.factories.web import (
    CONTENT,
    SHA256,
    Fetch,
    Handler,
    Names,
    Versioned,
    Web,
)

HALF = len(CONTENT) // 2


URL, OTHER = parse_url("https://files.example/a"), parse_url("https://files.example/b")
WHOLE = {"content-length": "100"}
REST = {"content-range": "bytes 40-99/100", "etag": '"1"'}
PARTIAL = PartialFile(URL, '"1"', 40)


def response(status: int, headers: dict[str, str], url: Url = URL) -> OutboundResponse:
    return OutboundResponse(url, status, headers, iter(()))


@pytest.mark.parametrize(
    ("partial", "answer", "action"),
    [
        (None, response(200, WHOLE), Action.RESTART),
        (PARTIAL, response(200, WHOLE), Action.RESTART),
        (PARTIAL, response(206, REST), Action.RESUME),
        (PARTIAL, response(200, REST), Action.RESUME),
        (PARTIAL, response(206, REST | {"content-range": "bytes 40-99/*"}), Action.RESUME),
        (PARTIAL, response(206, REST, OTHER), Action.DISCARD),
        (PARTIAL, response(206, REST | {"etag": '"2"'}), Action.DISCARD),
        (PARTIAL, response(206, REST | {"content-range": "bytes 0-99/100"}), Action.DISCARD),
        (PARTIAL, response(416, {}), Action.DISCARD),
        (PartialFile(URL, None, 40), response(206, REST), Action.DISCARD),
        (PartialFile(URL, None, 40), response(206, REST | {"etag": "none"}), Action.DISCARD),
        (None, response(200, WHOLE | {"content-encoding": " GZIP "}), Action.RESTART),
        (None, response(206, REST), FetchError),
        (PARTIAL, response(206, {}), FetchError),
        (PARTIAL, response(206, {"content-range": "bytes */100"}), FetchError),
        (None, response(200, WHOLE | {"content-encoding": "br"}), FetchError),
        (None, response(416, {}), FetchStatusError),
        (None, response(304, {}), FetchStatusError),
        (PARTIAL, response(404, {}), FetchStatusError),
    ],
)
def test_what_is_done_with_a_response(
    partial: PartialFile | None, answer: OutboundResponse, action: Action | type[FetchError]
) -> None:
    if isinstance(action, Action):
        assert choose_action(partial, answer) is action
    else:
        with pytest.raises(FetchError) as refused:
            choose_action(partial, answer)
        assert type(refused.value) is action


@pytest.mark.parametrize(
    ("headers", "size"),
    [
        (WHOLE, 100),
        (REST, 100),
        ({"content-range": "bytes 40-99/*", "content-length": "60"}, 0),
        ({}, 0),
        ({"content-length": "many"}, 0),
    ],
)
def test_the_size_that_is_announced(headers: dict[str, str], size: int) -> None:
    assert announced_size(response(200, headers)) == size


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


SECRET = "X-Amz-Signature=0123456789abcdef"


def test_a_file_that_is_announced_too_large_is_not_read(web: Web, fetch: Fetch) -> None:
    def huge(handler: Handler) -> None:
        handler.head(Content_Length=str(10**12))
        handler.drip()

    web.behaviours["/huge"] = huge
    with pytest.raises(FetchTooLargeError, match="1000000 bytes"):
        fetch(web.url("/huge"))


@pytest.mark.parametrize("chunked", [True, False])
def test_an_endless_file_is_left_at_the_limit(
    chunked: bool, web: Web, fetch: Fetch, blobs: BlobStore
) -> None:
    sent = 0

    def endless(handler: Handler) -> None:
        nonlocal sent
        handler.head(**({"Transfer_Encoding": "chunked"} if chunked else {"Connection": "close"}))
        block = bytes(1 << 16)
        while not handler.server.is_closing.is_set():
            handler.wfile.write(b"10000\r\n" + block + b"\r\n" if chunked else block)
            sent += len(block)

    web.behaviours["/endless"] = endless
    with pytest.raises(FetchTooLargeError):
        fetch(web.url("/endless"))
    assert sent < 50 * 10**6
    assert not list(blobs.incoming.iterdir())


def test_a_gzipped_answer_is_stored_as_it_comes(web: Web, fetch: Fetch, blobs: BlobStore) -> None:
    bomb = gzip.compress(bytes(5 * 10**6))
    web.behaviours["/bomb"] = lambda handler: handler.give(bomb, Content_Encoding="gzip")
    blob = fetch(web.url("/bomb"))
    assert blobs.path(blob.sha256).read_bytes() == bomb


@pytest.mark.parametrize("encoding", ["br", "zstd", "deflate", "gzip, gzip", "x"])
def test_other_encodings_are_refused(encoding: str, web: Web, fetch: Fetch) -> None:
    web.behaviours["/odd"] = lambda handler: handler.give(Content_Encoding=encoding)
    with pytest.raises(FetchError, match="compressed"):
        fetch(web.url("/odd"))


@pytest.mark.parametrize(
    "status", [204, 206, 300, 304, 400, 401, 403, 404, 410, 416, 429, 500, 503]
)
def test_any_answer_but_the_file_is_an_error(status: int, web: Web, fetch: Fetch) -> None:
    web.behaviours["/odd"] = lambda handler: handler.give(
        b"" if status in (204, 304) else b"secret of the server", status
    )
    with pytest.raises(FetchError) as refused:
        fetch(web.url(f"/odd?{SECRET}"))
    if status != 206:
        assert isinstance(refused.value, FetchStatusError)
        assert str(status) in str(refused.value)
    assert "secret" not in str(refused.value)
    assert "Signature" not in str(refused.value)
