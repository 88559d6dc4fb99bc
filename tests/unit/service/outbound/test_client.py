"""Requests and redirects."""

from __future__ import annotations

from ipaddress import ip_network

import pytest
import trustme

from service.outbound.errors import (
    AddressRefusedError,
    FetchError,
)
from service.outbound.url_policy import UrlPolicy
from service.storage.blobs import BlobStore
from tests.factories.tls import client_tls, server_tls
from tests.factories.web import CONTENT, LOOPBACK, OPEN, SHA256, Fetch, Handler, Names, Web, serving

SECRET = "X-Amz-Signature=0123456789abcdef"


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


def test_a_redirect_from_https_to_http_is_refused(
    authority: trustme.CA, web: Web, fetch: Fetch
) -> None:
    with serving(tls=server_tls(authority, "files.example")) as safe:
        safe.behaviours["/moved"] = lambda handler: handler.give(b"", 302, Location=web.url())
        with pytest.raises(AddressRefusedError, match="https to http"):
            fetch(safe.url("/moved"), tls=client_tls(authority))
    assert web.requests == []


def test_a_name_that_moves_between_redirects_is_checked_again(
    web: Web, fetch: Fetch, names: Names
) -> None:
    web.behaviours["/moved"] = lambda handler: handler.give(b"", 302, Location="/file")
    names.turns["files.example"] = [["127.0.0.1"], ["169.254.169.254"]]
    with pytest.raises(AddressRefusedError):
        fetch(web.url("/moved"))
    assert [path for path, _ in web.requests] == ["/moved"]


REDIRECTS = [
    "http://127.0.0.2:{port}/file",
    "http://[::1]:{port}/file",
    "http://[::ffff:127.0.0.1]:{port}/file",
    "http://169.254.169.254/latest/meta-data/",
    "http://intern.example:{port}/file",
    "//intern.example:{port}/file",
    "http://user@files.example:{port}/file",
    "http://2130706433:{port}/file",
    "http://files.example:22/",
    "file:///etc/passwd",
    "gopher://files.example/",
    "ftp://files.example/",
    "http://[",
    "http://files.example:{port}\\file",
    "http://fi\u00e9.example/",
]


@pytest.mark.parametrize("location", REDIRECTS)
def test_a_redirect_is_checked_like_any_url(
    location: str, web: Web, fetch: Fetch, names: Names
) -> None:
    names.answers["intern.example"] = ["10.0.0.1"]
    place = location.format(port=web.server_port)
    web.behaviours["/moved"] = lambda handler: handler.give(b"", 302, Location=place)
    with pytest.raises(AddressRefusedError):
        fetch(web.url("/moved"), UrlPolicy(networks=(ip_network("127.0.0.1/32"),)))
    assert [path for path, _ in web.requests] == ["/moved"]


def test_a_redirect_to_a_host_that_is_not_named_is_refused(
    web: Web, fetch: Fetch, names: Names
) -> None:
    names.answers["other.example"] = ["127.0.0.1"]
    web.behaviours["/moved"] = lambda handler: handler.give(
        b"", 302, Location=web.url(host="other.example")
    )
    rules = UrlPolicy(hosts=("files.example",), networks=OPEN.networks)
    with pytest.raises(AddressRefusedError, match="MPE_URL_HOSTS"):
        fetch(web.url("/moved"), rules)
