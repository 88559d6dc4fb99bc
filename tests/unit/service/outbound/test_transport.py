"""The door and TLS: who the server is, and that nothing is sent to anybody else."""

from __future__ import annotations

import hashlib
import ssl

import pytest
import trustme

from service.outbound.errors import AddressRefusedError, FetchTlsError
from tests.factories.web import CONTENT, Fetch, Web, serving

SHA256 = hashlib.sha256(CONTENT).hexdigest()


@pytest.fixture(scope="module")
def authority() -> trustme.CA:
    return trustme.CA()


def server_tls(authority: trustme.CA, *names: str) -> ssl.SSLContext:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    authority.issue_cert(*names).configure_cert(context)
    return context


def client_tls(authority: trustme.CA) -> ssl.SSLContext:
    context = ssl.create_default_context()
    authority.configure_trust(context)
    return context


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


def test_a_redirect_from_https_to_http_is_refused(
    authority: trustme.CA, web: Web, fetch: Fetch
) -> None:
    with serving(tls=server_tls(authority, "files.example")) as safe:
        safe.behaviours["/moved"] = lambda handler: handler.give(b"", 302, Location=web.url())
        with pytest.raises(AddressRefusedError, match="https to http"):
            fetch(safe.url("/moved"), tls=client_tls(authority))
    assert web.requests == []
