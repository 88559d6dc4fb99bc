"""Without keys, pages of other sites reach nothing: not by rebinding a name, not by a form."""

from __future__ import annotations

import re
from collections.abc import Iterator

import httpx
import pytest
import yaml

from tests.factories.scans import arms, as_npy
from tests.factories.server import PROJECT, Server, registered, running_server

CLOUD = as_npy(arms(1))
PAGE = "https://lab.example.org"
EVIL = "https://evil.example"
OPEN = ("/livez", "/readyz", "/openapi.json")
ROUTES = [
    (method.upper(), re.sub(r"\{\w+\}", "thing", path))
    for path, operations in yaml.safe_load((PROJECT / "openapi.yaml").read_text())["paths"].items()
    for method in operations
    if path not in OPEN
]
CHANGES = [(method, path) for method, path in ROUTES if method not in ("GET", "HEAD", "OPTIONS")]


@pytest.fixture(scope="module")
def named(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """Others may reach it, by two names; pages of one origin may call."""
    directory = tmp_path_factory.mktemp("named")
    names = "mpe, Scans.example.org"
    with running_server(
        directory, allow_anonymous_remote=True, allowed_hosts=names, cors_origins=PAGE, workers=1
    ) as server:
        yield server


def refused(answer: httpx.Response, status: int, kind: str, setting: str) -> None:
    assert answer.status_code == status
    assert answer.headers["Content-Type"] == "application/problem+json"
    assert answer.headers["X-Content-Type-Options"] == "nosniff"
    problem = answer.json()
    assert problem["type"] == f"urn:mpe:problem:{kind}"
    assert setting in problem["detail"]
    assert "evil" not in answer.text


def asked(
    server: Server, host: str, method: str = "GET", path: str = "/v1/formats"
) -> httpx.Response:
    return server.client.request(method, path, headers={"Host": host})


@pytest.mark.parametrize(
    "host",
    ["localhost", "LocalHost:80", "127.0.0.1", "127.0.0.1:{port}", "127.8.0.1:1", "[::1]:{port}"],
)
def test_names_of_this_machine(server: Server, named: Server, host: str) -> None:
    for one in (server, named):
        assert asked(one, host.format(port=one.port)).status_code == 200


STRANGE = [
    "evil.example",
    "evil.example:{port}",
    "localhost.evil.example",
    "evil-localhost",
    "127.0.0.1.evil.example:{port}",
    "localhost@evil.example",
    "localhost,evil.example",
    "192.168.1.7:{port}",
    "0.0.0.0:{port}",
    "2130706433",
    "[2001:db8::1]:{port}",
    "[::1",
    "example.org",
]


@pytest.mark.parametrize("host", [*STRANGE, "mpe:{port}", "scans.example.org"])
def test_other_names_are_refused(server: Server, host: str) -> None:
    answer = asked(server, host.format(port=server.port))
    refused(answer, 421, "host-refused", "MPE_ALLOWED_HOSTS")


@pytest.mark.parametrize("host", ["mpe", "mpe:{port}", "scans.example.org", "SCANS.example.org:1"])
def test_names_that_are_listed(named: Server, host: str) -> None:
    assert asked(named, host.format(port=named.port)).status_code == 200


@pytest.mark.parametrize("host", STRANGE)
def test_names_that_are_not_listed(named: Server, host: str) -> None:
    answer = asked(named, host.format(port=named.port))
    refused(answer, 421, "host-refused", "MPE_ALLOWED_HOSTS")


@pytest.mark.parametrize(("method", "path"), ROUTES)
def test_every_route_looks_at_the_name(server: Server, method: str, path: str) -> None:
    answer = asked(server, "evil.example", method, path)
    if method == "HEAD":
        assert answer.status_code == 421
    else:
        refused(answer, 421, "host-refused", "MPE_ALLOWED_HOSTS")


@pytest.mark.parametrize("path", OPEN)
def test_what_needs_no_key_has_no_name(server: Server, path: str) -> None:
    assert asked(server, "10.0.0.7:8000", path=path).status_code == 200


@pytest.mark.parametrize(("method", "path"), CHANGES)
def test_a_page_of_another_site_changes_nothing(server: Server, method: str, path: str) -> None:
    answer = server.client.request(method, path, headers={"Origin": EVIL})
    refused(answer, 403, "origin-refused", "MPE_CORS_ORIGINS")


@pytest.mark.parametrize("origin", [EVIL, "null", "http://localhost", "http://127.0.0.1:1", "["])
def test_a_form_of_another_site_leaves_nothing(server: Server, named: Server, origin: str) -> None:
    for one in (server, named):
        before = one.client.get("/v1/registrations").json()
        answer = one.submit(CLOUD, CLOUD, headers={"Origin": origin})
        refused(answer, 403, "origin-refused", "MPE_CORS_ORIGINS")
        assert one.client.get("/v1/registrations").json() == before
        assert not list((one.data_dir / "incoming").iterdir())


def test_pages_that_may(server: Server, named: Server) -> None:
    headers = {"Origin": server.url}
    assert registered(server.client, CLOUD, CLOUD, headers=headers)["result"]["overlap"] == 1
    for origin in (PAGE, PAGE.upper()):
        put = named.client.put("/v1/clouds/arms", content=CLOUD, headers={"Origin": origin})
        assert put.is_success
    own = {"Origin": f"https://scans.example.org:{named.port}"}
    own["Host"] = own["Origin"].removeprefix("https://")
    assert named.client.delete("/v1/clouds/arms", headers=own).status_code == 204


def test_a_page_may_look_and_is_not_told(server: Server) -> None:
    answer = server.client.get("/v1/formats", headers={"Origin": EVIL})
    assert answer.status_code == 200  # the browser keeps it from the page
    assert "access-control-allow-origin" not in answer.headers
