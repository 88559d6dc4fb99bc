"""What the door lets in, and how much of it, how fast and from whom."""

from __future__ import annotations

import gzip
import hashlib
import socket
import threading
import time

import pytest

from service.outbound.errors import (
    FetchError,
    FetchNameError,
    FetchStatusError,
    FetchTooLargeError,
    FetchTooSlowError,
    FetchUnreachableError,
)
from service.outbound.url_policy import UrlPolicy
from service.storage.blobs import BlobStore
from tests.factories.web import CONTENT, LOOPBACK, Fetch, Handler, Names, Web, serving

SECRET = "X-Amz-Signature=0123456789abcdef"
SHA256 = hashlib.sha256(CONTENT).hexdigest()


def test_the_file_is_stored_by_its_hash(web: Web, fetch: Fetch, blobs: BlobStore) -> None:
    blob = fetch(web.url("/file?part=1"))
    assert (blob.sha256, blob.size) == (SHA256, len(CONTENT))
    assert blobs.path(SHA256).read_bytes() == CONTENT
    ((path, headers),) = web.requests
    assert path == "/file?part=1"
    assert headers["host"] == f"files.example:{web.server_port}"
    assert headers["accept-encoding"] == "identity"
    assert not {"cookie", "authorization", "range", "if-none-match", "referer"} & headers.keys()


def test_a_named_host_is_fetched_from(web: Web, fetch: Fetch) -> None:
    assert fetch(web.url(), UrlPolicy(hosts=("files.example",), networks=LOOPBACK)).sha256 == SHA256


def test_over_ip_6(fetch: Fetch, names: Names) -> None:
    with serving("::1") as web:
        names.answers["files.example"] = ["::1"]
        assert fetch(web.url()).sha256 == SHA256
        assert fetch(web.url(host="[::1]")).sha256 == SHA256
        assert web.requests[1][1]["host"] == f"[::1]:{web.server_port}"


def test_the_next_address_is_tried_when_one_does_not_answer(
    web: Web, fetch: Fetch, names: Names
) -> None:
    names.answers["files.example"] = ["127.0.0.2", "127.0.0.1"]
    assert fetch(web.url()).sha256 == SHA256


def test_proxies_of_the_environment_are_not_asked(
    web: Web, fetch: Fetch, monkeypatch: pytest.MonkeyPatch
) -> None:
    with serving() as proxy:
        for name in ("http_proxy", "HTTP_PROXY", "https_proxy", "ALL_PROXY", "all_proxy"):
            monkeypatch.setenv(name, f"http://127.0.0.1:{proxy.server_port}")
        assert fetch(web.url()).sha256 == SHA256
        assert proxy.connections == 0


def test_redirects_are_followed_without_what_the_first_server_set(
    web: Web, fetch: Fetch, names: Names
) -> None:
    names.answers["other.example"] = ["127.0.0.1"]
    there = web.url("/file", host="other.example")
    web.behaviours["/moved"] = lambda handler: handler.give(
        b"", 302, Location=there, Set_Cookie="session=1; Path=/"
    )
    web.behaviours["/relative"] = lambda handler: handler.give(b"", 307, Location="moved")
    assert fetch(web.url("/relative")).sha256 == SHA256
    assert [path for path, _ in web.requests] == ["/relative", "/moved", "/file"]
    assert "cookie" not in web.requests[2][1]


@pytest.mark.parametrize(("count", "works"), [(5, True), (6, False)])
def test_five_redirects_are_enough(count: int, works: bool, web: Web, fetch: Fetch) -> None:
    for step in range(count):
        web.behaviours[f"/{step}"] = lambda handler, step=step: handler.give(
            b"", 301, Location="/file" if step + 1 == count else f"/{step + 1}"
        )
    if works:
        assert fetch(web.url("/0")).sha256 == SHA256
    else:
        with pytest.raises(FetchError, match="redirects"):
            fetch(web.url("/0"))
        assert len(web.requests) == 6


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


def test_a_name_without_address(fetch: Fetch) -> None:
    with pytest.raises(FetchNameError):
        fetch("http://nobody.example/")


def test_a_resolver_that_does_not_answer_is_not_waited_for(
    fetch: Fetch, names: Names, monkeypatch: pytest.MonkeyPatch
) -> None:
    answer = threading.Event()
    monkeypatch.setattr(Names, "__call__", lambda *_: answer.wait(30) and ["127.0.0.1"])
    with pytest.raises(FetchTooSlowError, match="resolved"):
        fetch("http://files.example/", total_s=0.2)
    answer.set()


def test_a_port_where_nothing_listens(fetch: Fetch) -> None:
    with socket.socket() as bound:
        bound.bind(("127.0.0.1", 0))
        with pytest.raises(FetchUnreachableError):
            fetch(f"http://files.example:{bound.getsockname()[1]}/")


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


def drip_head(handler: Handler) -> None:
    handler.wfile.write(b"HTTP/1.1 200 OK\r\nX: ")
    handler.drip()


def drip_body(handler: Handler) -> None:
    handler.head(Content_Length=str(10**5))
    handler.drip()


def drip_chunks(handler: Handler) -> None:
    handler.head(Transfer_Encoding="chunked")
    while not handler.server.is_closing.is_set():
        handler.wfile.write(b"1\r\nx\r\n")
        time.sleep(0.02)


def go_on_and_on(handler: Handler) -> None:
    while not handler.server.is_closing.is_set():
        handler.wfile.write(b"HTTP/1.1 100 Continue\r\n\r\n")
        time.sleep(0.02)


SLOW = [drip_head, drip_body, drip_chunks, go_on_and_on]


@pytest.mark.parametrize("behaviour", SLOW)
def test_a_slow_drip_is_too_slow(behaviour: object, web: Web, fetch: Fetch) -> None:
    web.behaviours["/slow"] = behaviour  # type: ignore[assignment]
    with pytest.raises(FetchTooSlowError, match=r"bytes per second|send on in time"):
        fetch(web.url("/slow"), read_timeout_s=0.3, min_bytes_per_s=10_000)


@pytest.mark.parametrize("behaviour", SLOW)
def test_time_is_bounded_whatever_the_speed(behaviour: object, web: Web, fetch: Fetch) -> None:
    web.behaviours["/slow"] = behaviour  # type: ignore[assignment]
    with pytest.raises(FetchTooSlowError):
        fetch(web.url("/slow"), total_s=0.5)


def silent(handler: Handler) -> None:
    handler.server.is_closing.wait(20)


def silent_after_the_head(handler: Handler) -> None:
    handler.head(Content_Length="1000")
    handler.wfile.flush()
    handler.server.is_closing.wait(20)


@pytest.mark.parametrize("behaviour", [silent, silent_after_the_head])
def test_a_server_that_falls_silent_is_left(behaviour: object, web: Web, fetch: Fetch) -> None:
    web.behaviours["/silent"] = behaviour  # type: ignore[assignment]
    with pytest.raises(FetchTooSlowError):
        fetch(web.url("/silent"), read_timeout_s=0.3)


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
    "answer",
    [
        b"nonsense\r\n\r\n",
        b"HTTP/1.1 200 OK\r\nContent-Length: -1\r\n\r\n",
        b"HTTP/1.1 200 OK\r\nContent-Length: " + b"9" * 5000 + b"\r\n\r\n",
        b"HTTP/1.1 200 OK\r\nContent-Length: 3\r\nContent-Length: 4\r\n\r\nabc",
        b"HTTP/1.1 200 OK\r\nA: " + b"x" * 200_000 + b"\r\n\r\n",
        b"",
    ],
)
def test_what_is_no_http_is_an_error(answer: bytes, web: Web, fetch: Fetch) -> None:
    def say(handler: Handler) -> None:
        handler.wfile.write(answer)
        handler.close_connection = True

    web.behaviours["/odd"] = say
    with pytest.raises(FetchError):
        fetch(web.url("/odd"))
