"""URLs that are not fetched, or not to the end: each is told why."""

from __future__ import annotations

import ssl
from collections.abc import Iterator

import pytest
import trustme

from service.outbound import FetchPolicy, check_source
from service.outbound.errors import AddressRefusedError
from service.settings import S3Settings, Settings, UrlSettings
from tests.factories.scans_online import post, scans_online
from tests.factories.server import Server, running_server
from tests.factories.web import Web, serving


@pytest.fixture(scope="module")
def web() -> Iterator[Web]:
    with scans_online() as running:
        yield running


@pytest.fixture(scope="module")
def fetching(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    directory = tmp_path_factory.mktemp("fetching")
    with running_server(
        directory, private_networks="127.0.0.0/8, ::1/128", max_body_bytes=20_000_000
    ) as server:
        yield server


@pytest.fixture(scope="module")
def impatient(tmp_path_factory: pytest.TempPathFactory, web: Web) -> Iterator[Server]:
    """It calls one host at one port, and waits for nobody."""
    directory = tmp_path_factory.mktemp("impatient")
    with running_server(
        directory,
        url_hosts="127.0.0.1, nobody.invalid",
        url_ports=web.server_port,
        private_networks="127.0.0.0/8",
        url_read_timeout_s=1,
    ) as server:
        yield server


@pytest.mark.parametrize(
    ("url", "kind", "words"),
    [
        ("http://127.0.0.1:{port}/missing", "fetch-status", "404"),
        ("http://127.0.0.1:{port}/round", "fetch-failed", "redirects"),
        ("http://127.0.0.1:{port}/large", "fetch-too-large", "20000000 bytes"),
        ("https://127.0.0.1:{port}/cloud.npy", "fetch-tls", "TLS"),
        ("http://127.0.0.1:14999/cloud.npy", "fetch-failed", "reached"),
    ],
)
def test_what_cannot_be_fetched_is_explained(
    fetching: Server, web: Web, url: str, kind: str, words: str
) -> None:
    response = post(fetching, web.url("/cloud.npy", "127.0.0.1"), url.format(port=web.server_port))
    assert response.status_code == 422
    problem = response.json()
    assert problem["type"] == f"urn:mpe:problem:{kind}"
    assert words in problem["detail"]
    assert problem["detail"].startswith("target: ")
    job = fetching.client.get(f"/v1/registrations/{problem['job']}").json()
    assert job["status"] == "failed"
    assert job["error"]["type"] == problem["type"]


def test_a_slow_drip_is_not_waited_for(impatient: Server, web: Web) -> None:
    problem = post(impatient, web.url("/drip", "127.0.0.1")).json()
    assert problem["type"] == "urn:mpe:problem:fetch-too-slow"


def test_a_name_that_nobody_has(impatient: Server, web: Web) -> None:
    problem = post(impatient, web.url("/cloud.npy", "nobody.invalid")).json()
    name, slow = (f"urn:mpe:problem:fetch-{end}" for end in ("name", "too-slow"))
    assert problem["type"] in (name, slow), "or nobody who knows names answered in time"
    assert "resolved" in problem["detail"]


def test_a_certificate_of_nobody_known(fetching: Server) -> None:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    trustme.CA().issue_cert("localhost").configure_cert(context)
    with serving(tls=context) as impostor:
        response = post(fetching, impostor.url("/file", "localhost"))
        assert response.json()["type"] == "urn:mpe:problem:fetch-tls"
        assert impostor.requests == []


@pytest.mark.parametrize(
    ("url", "status"),
    [
        ("http://user:word@127.0.0.1/cloud.npy", 403),
        ("http://10.0.0.1/cloud.npy", 403),
        ("http://169.254.169.254/latest/meta-data/", 403),
        ("http://[::ffff:127.0.0.1]/cloud.npy", 403),
        ("http://2130706433/cloud.npy", 403),
        ("http://0x7f.1/cloud.npy", 403),
        ("http://127.0.0.1:22/", 403),
        ("s3://bucket/cloud.npy", 403),
        ("file:///etc/passwd", 422),
        ("gopher://127.0.0.1/", 422),
        ("cloud.npy", 422),
    ],
)
def test_other_addresses_are_refused_at_once(
    fetching: Server, web: Web, url: str, status: int
) -> None:
    response = post(fetching, url, web.url("/cloud.npy", "127.0.0.1"))
    assert response.status_code == status
    assert "job" not in response.json()
    assert "passwd" not in response.text


def test_a_redirect_to_what_may_not_be_called(fetching: Server, web: Web) -> None:
    response = post(fetching, web.url("/to-metadata", "127.0.0.1"))
    assert response.status_code == 403
    problem = response.json()
    assert problem["type"] == "urn:mpe:problem:address-refused"
    assert "169.254" not in problem["detail"]
    job = fetching.client.get(f"/v1/registrations/{problem['job']}").json()
    assert job["error"]["type"] == problem["type"]


def test_private_networks_are_closed_by_default(server: Server) -> None:
    with serving() as intern:
        for host in ("127.0.0.1", "localhost"):
            response = post(server, intern.url("/file", host))
            assert response.status_code == 403
            assert response.json()["type"] == "urn:mpe:problem:address-refused"
            assert "public network" in response.json()["detail"]
        assert intern.connections == 0


@pytest.mark.parametrize(
    ("url", "word"),
    [
        ("http://127.0.0.2:{port}/cloud.npy", "MPE_URL_HOSTS"),
        ("http://example.org:{port}/cloud.npy", "MPE_URL_HOSTS"),
        ("http://127.0.0.1/cloud.npy", "port"),
    ],
)
def test_hosts_and_ports_can_be_limited(impatient: Server, web: Web, url: str, word: str) -> None:
    response = post(impatient, url.format(port=web.server_port))
    assert response.status_code == 403
    assert word in response.json()["detail"]


def test_fetching_can_be_turned_off() -> None:
    settings = Settings(url=UrlSettings(fetching=False), s3=S3Settings(buckets=("scans",)))
    policy = FetchPolicy.of(settings)
    for url in ("https://example.org/", "s3://scans/a"):
        with pytest.raises(AddressRefusedError, match="MPE_URL_FETCHING"):
            check_source(url, policy)
