"""Connections go to addresses that were checked, and TLS is with the name."""

from __future__ import annotations

import socket
import threading

import pytest
import trustme

from service.outbound.errors import (
    AddressRefusedError,
    FetchNameError,
    FetchTlsError,
    FetchTooSlowError,
    FetchUnreachableError,
)
from service.outbound.url_policy import UrlPolicy
from tests.factories.tls import client_tls, server_tls
from tests.factories.web import SHA256, Fetch, Names, Web, serving


def test_tls_is_with_the_name_though_an_address_is_dialled(
    authority: trustme.CA, fetch: Fetch
) -> None:
    asked: list[str | None] = []
    context = server_tls(authority, "files.example")
    context.sni_callback = lambda _socket, name, _context: asked.append(name)
    with serving(tls=context) as web:
        assert fetch(web.url(), tls=client_tls(authority)).sha256 == SHA256
        assert web.requests[0][1]["host"] == f"files.example:{web.server_port}"
    assert asked == ["files.example"]


@pytest.mark.parametrize(
    ("named", "trusted"), [("files.example", False), ("other.example", True), ("127.0.0.1", True)]
)
def test_a_server_that_is_not_who_it_should_be_is_sent_nothing(
    named: str, trusted: bool, authority: trustme.CA, fetch: Fetch
) -> None:
    with serving(tls=server_tls(authority, named)) as web:
        known = authority if trusted else trustme.CA()
        with pytest.raises(FetchTlsError, match="certificate"):
            fetch(web.url(), tls=client_tls(known))
        assert web.requests == []


def test_https_where_no_tls_is_spoken(web: Web, fetch: Fetch) -> None:
    with pytest.raises(FetchTlsError):
        fetch(web.url().replace("http:", "https:"))


@pytest.mark.parametrize(
    "address", ["10.0.0.1", "127.0.0.1", "169.254.169.254", "::1", "fc00::1", "::ffff:8.8.8.8"]
)
def test_a_name_of_such_an_address_is_refused(address: str, fetch: Fetch, names: Names) -> None:
    names.answers["files.example"] = [address]
    with pytest.raises(AddressRefusedError, match="not on the public network") as refused:
        fetch("http://files.example/file", UrlPolicy())
    assert address not in str(refused.value)
    assert names.asked == ["files.example"]


def test_one_address_of_many_that_is_not_public_is_enough(
    web: Web, fetch: Fetch, names: Names
) -> None:
    names.answers["files.example"] = ["127.0.0.1", "10.0.0.1"]
    with pytest.raises(AddressRefusedError):
        fetch(web.url())
    assert web.connections == 0


def test_the_address_that_was_checked_is_dialled_though_the_name_has_moved(
    fetch: Fetch, names: Names
) -> None:
    with serving("127.0.0.2") as good, serving("127.0.0.3") as other:
        names.turns["files.example"] = [["127.0.0.2"], ["127.0.0.3"], ["10.0.0.1"]]
        assert fetch(good.url()).size > 0
        assert (good.connections, other.connections) == (1, 0)
    assert names.asked == ["files.example"]


def test_a_name_that_moves_before_a_further_try_is_checked_again(
    web: Web, fetch: Fetch, names: Names
) -> None:
    web.behaviours["/cut"] = lambda handler: handler.give_part(0, 10, ETag='"1"')
    names.turns["files.example"] = [["127.0.0.1"], ["10.0.0.1"]]
    with pytest.raises(AddressRefusedError):
        fetch(web.url("/cut"))
    assert web.connections == 1


def test_a_server_on_this_machine_is_not_even_connected_to(
    web: Web, fetch: Fetch, names: Names
) -> None:
    names.answers["localhost.example"] = ["127.0.0.1"]
    for url in (web.url(host="127.0.0.1"), web.url(host="localhost.example")):
        with pytest.raises(AddressRefusedError):
            fetch(url, UrlPolicy())
    assert web.connections == 0


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
