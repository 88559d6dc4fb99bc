"""s3:// addresses, from a real server of S3 (rclone) that checks signatures."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from tests.factories.s3 import KEY, SECRET, running_s3
from tests.factories.scans import arms, as_npy
from tests.factories.server import Server, running_server

CLOUD = as_npy(arms(1))


@pytest.fixture(scope="module")
def endpoint(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    root = tmp_path_factory.mktemp("s3")
    for bucket in ("scans", "payroll"):
        (root / bucket / "doors").mkdir(parents=True)
        (root / bucket / "doors" / "left 1+ü.npy").write_bytes(CLOUD)
    with running_s3(root) as s3:
        yield s3.endpoint


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory, endpoint: str) -> Iterator[Server]:
    directory = tmp_path_factory.mktemp("s3-server")
    with running_server(
        directory,
        s3_buckets="scans, drafts",
        s3_endpoint=endpoint,
        s3_access_key_id=KEY,
        s3_secret_access_key=SECRET,
    ) as running:
        yield running


def post(server: Server, url: str) -> httpx.Response:
    request = {"source": {"url": url}, "target": {"url": url}}
    return server.client.post("/v1/registrations", json=request, headers={"Prefer": "wait=60"})


def test_an_object_is_fetched_in_the_name_of_the_service(server: Server) -> None:
    job = post(server, "s3://scans/doors/left 1+ü.npy").json()
    assert job["status"] == "succeeded", job
    assert job["source"]["url"] == "s3://scans/doors/left 1+ü.npy"
    assert job["source"]["sha256"] == hashlib.sha256(CLOUD).hexdigest()
    assert SECRET not in server.log
    assert "X-Amz" not in server.log


@pytest.mark.parametrize(
    ("url", "status", "kind", "words"),
    [
        ("s3://scans/missing.npy", 422, "fetch-status", "404"),
        ("s3://drafts/missing.npy", 422, "fetch-status", "404"),
        ("s3://scans/a/../../payroll/b.npy", 422, "fetch-failed", "key"),
        ("s3://payroll/doors/left 1+ü.npy", 403, "address-refused", "MPE_S3_BUCKETS"),
        ("s3://scans", 403, "address-refused", "s3://bucket/key"),
        ("s3://key:word@scans/a.npy", 403, "address-refused", "s3://bucket/key"),
    ],
)
def test_what_cannot_be_had_is_explained(
    server: Server, url: str, status: int, kind: str, words: str
) -> None:
    response = post(server, url)
    problem = response.json()
    assert (response.status_code, problem["type"]) == (status, f"urn:mpe:problem:{kind}")
    assert words in problem["detail"]


def test_the_server_of_the_buckets_is_open_to_nothing_else(server: Server, endpoint: str) -> None:
    response = post(server, f"{endpoint}/scans/doors/left%201+%C3%BC.npy")
    assert response.status_code == 403
    assert response.json()["type"] == "urn:mpe:problem:address-refused"


def test_a_wrong_secret(tmp_path: Path, endpoint: str) -> None:
    settings = {"s3_access_key_id": KEY, "s3_secret_access_key": "wrong"}
    with running_server(tmp_path, s3_buckets="scans", s3_endpoint=endpoint, **settings) as server:
        problem = post(server, "s3://scans/doors/left 1+ü.npy").json()
    assert problem["type"] == "urn:mpe:problem:fetch-status"
    assert "403" in problem["detail"]
