"""What answers tell browsers and caches, which pages may call, and which methods a path has."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator

import httpx
import pytest
import yaml

from tests.factories.scans import arms, as_npy
from tests.factories.server import CALL_S, PROJECT, Server, registered, running_server

CLOUD = as_npy(arms(1))
PAGE = "https://lab.example.org"
PATHS = yaml.safe_load((PROJECT / "openapi.yaml").read_text())["paths"]


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """Of this file alone: its blobs are removed."""
    with running_server(tmp_path_factory.mktemp("server")) as running:
        yield running


@pytest.fixture(scope="module")
def calling(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A server that pages of two origins may call."""
    origins = f"{PAGE}, http://localhost:5173"
    with running_server(tmp_path_factory.mktemp("cors"), cors_origins=origins) as server:
        yield server


def protected(response: httpx.Response) -> None:
    headers = response.headers
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert headers["Content-Security-Policy"] == "default-src 'none'; frame-ancestors 'none'"
    assert headers["Referrer-Policy"] == "no-referrer"
    assert "Server" not in headers
    if response.url.path.startswith("/v1/"):
        assert headers.get_list("Cache-Control") == ["no-store"]


def test_every_answer_is_protected(server: Server) -> None:
    job = registered(server.client, CLOUD, CLOUD)
    place = f"/v1/registrations/{job['id']}"
    for path in (
        *(place, f"{place}/inliers", f"{place}/inliers?format=npy", f"{place}/aligned"),
        *(f"{place}/events", f"{place}/deliveries", "/v1/clouds", "/v1/formats"),
        *("/livez", "/readyz", "/metrics", "/openapi.json"),
    ):
        answer = server.client.get(path)
        assert answer.status_code == 200
        protected(answer)
    for path in ("/nothing", "/v1/nothing", "/v1/clouds/none", "/v1/registrations?limit=0"):
        protected(server.client.get(path))
    protected(server.client.options("/v1/uploads"))
    protected(server.client.put("/v1/registrations"))


def test_a_lost_result_is_a_protected_problem(server: Server) -> None:
    """And it is one from the first byte on, not a document that breaks off."""
    job = registered(server.client, CLOUD, CLOUD, options='{"seed": 5}')
    shutil.rmtree(server.data_dir / "blobs")
    url = f"{server.url}/v1/registrations/{job['id']}"
    answers = [
        httpx.get(url + what, trust_env=False, timeout=CALL_S)
        for what in ("", "/inliers", "/inliers?format=npy")
    ]
    (server.data_dir / "blobs").mkdir()
    for broken in answers:
        assert broken.status_code == 410
        assert broken.json()["type"] == "urn:mpe:problem:expired"
        protected(broken)


def test_transport_security_where_there_is_any(server: Server) -> None:
    name = "Strict-Transport-Security"
    assert name not in server.client.get("/v1/formats").headers
    behind_tls = server.client.get("/v1/formats", headers={"X-Forwarded-Proto": "https"})
    assert "max-age=" in behind_tls.headers[name]


def test_downloads_have_a_plain_name(server: Server) -> None:
    job = registered(server.client, CLOUD, CLOUD, options='{"seed": 6}')
    for path, name in (
        ("inliers?format=npy", "inliers.npy"),
        ("aligned?format=laz", "aligned.laz"),
    ):
        answer = server.client.get(f"/v1/registrations/{job['id']}/{path}")
        expected = f'attachment; filename="{job["id"]}-{name}"'
        assert answer.headers["Content-Disposition"] == expected


def cors(response: httpx.Response) -> set[str]:
    return {name for name in response.headers if name.startswith("access-control-")}


def preflight(server: Server, path: str, method: str, origin: str = PAGE) -> httpx.Response:
    headers = {"Origin": origin, "Access-Control-Request-Method": method}
    headers["Access-Control-Request-Headers"] = "authorization, idempotency-key"
    return server.client.options(path, headers=headers)


def test_no_page_may_call_by_default(server: Server) -> None:
    assert not cors(server.client.get("/v1/formats", headers={"Origin": PAGE}))
    assert not cors(preflight(server, "/v1/registrations", "POST"))


@pytest.mark.parametrize("origin", [PAGE, "http://localhost:5173"])
def test_pages_that_are_named_may_call(calling: Server, origin: str) -> None:
    asked = preflight(calling, "/v1/registrations", "POST", origin)
    assert asked.status_code == 200
    assert asked.headers["Access-Control-Allow-Origin"] == origin
    answer = calling.client.get("/v1/formats", headers={"Origin": origin})
    assert answer.headers["Access-Control-Allow-Origin"] == origin
    assert "Origin" in answer.headers["Vary"]
    assert "access-control-allow-credentials" not in cors(answer)
    refused = calling.client.get("/v1/clouds/none", headers={"Origin": origin})
    assert refused.status_code == 404
    assert refused.headers["Access-Control-Allow-Origin"] == origin
    protected(refused)


@pytest.mark.parametrize("origin", ["https://evil.example.org", f"{PAGE}.evil.org", "null"])
def test_other_pages_may_not(calling: Server, origin: str) -> None:
    allowed = "access-control-allow-origin"
    assert preflight(calling, "/v1/registrations", "POST", origin).status_code == 400
    assert allowed not in cors(preflight(calling, "/v1/registrations", "POST", origin))
    assert allowed not in cors(calling.client.get("/v1/formats", headers={"Origin": origin}))


def test_pages_may_use_every_method_and_header_of_the_description(calling: Server) -> None:
    asked = preflight(calling, "/v1/registrations", "POST")
    methods = set(re.split(", *", asked.headers["Access-Control-Allow-Methods"].lower()))
    headers = set(re.split(", *", asked.headers["Access-Control-Allow-Headers"].lower()))
    for path, operations in PATHS.items():
        assert set(operations) - {"options"} <= methods, path
        for operation in operations.values():
            given = {
                p["name"].lower() for p in operation.get("parameters", ()) if p["in"] == "header"
            }
            assert given <= headers, path
    assert {"authorization", "content-type"} <= headers


@pytest.mark.parametrize("path", list(PATHS))
def test_405_names_all_methods_of_the_path(server: Server, path: str) -> None:
    known = {method.upper() for method in PATHS[path]}
    place = re.sub(r"\{\w+\}", "thing", path)
    for method in {"GET", "PUT", "POST", "PATCH", "DELETE", "TRACE"} - known:
        answer = server.client.request(method, place)
        assert answer.status_code == 405
        assert set(answer.headers["Allow"].split(", ")) - {"HEAD"} == known - {"HEAD"}
        assert answer.headers["Content-Type"] == "application/problem+json"
