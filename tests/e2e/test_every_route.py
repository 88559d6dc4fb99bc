"""Every route, on both stores: files in the data directory, and in a bucket."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator

import httpx
import pytest
import yaml

from tests.factories.receiver import Receiver, receiving
from tests.factories.s3 import S3Server
from tests.factories.scans import arms, as_npy
from tests.factories.server import PROJECT, Server, finished, running_server
from tests.factories.tenants import caller, new_key

CLOUD = as_npy(arms(1))
QUOTA = 200_000
JOBS, CLOUDS, UPLOADS = "/v1/registrations", "/v1/clouds", "/v1/uploads"
TUS = {"Tus-Resumable": "1.0.0"}
PIECE = {**TUS, "Content-Type": "application/offset+octet-stream"}
ROUTES = {
    (method.upper(), path)
    for path, methods in yaml.safe_load((PROJECT / "openapi.yaml").read_text())["paths"].items()
    for method in methods
}


@pytest.fixture(scope="module")
def receiver() -> Iterator[Receiver]:
    with receiving() as running:
        yield running


@pytest.fixture(scope="module", params=["directory", "bucket"])
def server(
    request: pytest.FixtureRequest, s3: S3Server, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Server]:
    settings: dict[str, object] = {"require_keys": True, "workers": 1, "webhook_secret": "s"}
    settings |= {"webhook_hosts": "127.0.0.1", "private_networks": "127.0.0.0/8"}
    if request.param == "bucket":
        settings |= {**s3.new_prefix(), "blob_public_endpoint": s3.endpoint}
    with running_server(tmp_path_factory.mktemp(request.param), **settings) as running:
        yield running


class Walk:
    """Calls as one tenant, and the routes that answered as they should."""

    def __init__(self, client: httpx.Client) -> None:
        self.client = client
        self.walked: set[tuple[str, str]] = set()

    def __call__(self, status: int, method: str, path: str, **sent: object) -> httpx.Response:
        answer = self.client.request(method, path, **sent)  # type: ignore[arg-type]
        assert answer.status_code == status, (method, path, answer.text)
        self.walked.add((method, _template(answer.url.path)))
        return answer


def _template(path: str) -> str:
    """The path of the description that is meant: one without names of its own goes first."""
    paths = sorted({path for _, path in ROUTES}, key=lambda each: each.count("{"))
    return next(each for each in paths if re.fullmatch(re.sub(r"\{\w+\}", "[^/]+", each), path))


def test_every_route_answers(server: Server, receiver: Receiver) -> None:
    with caller(server, new_key(server, "lab", stored_bytes=QUOTA)) as client:
        walk = Walk(client)
        _walk_clouds(walk)
        uploaded = _walk_uploads(walk)
        body = {"source": {"cloud": uploaded}, "target": {"cloud": "door"}}
        job = walk(202, "POST", JOBS, json=body | {"callback_url": receiver.url}).json()["id"]
        assert finished(client, job)["status"] == "succeeded"
        _walk_job(walk, f"{JOBS}/{job}")
        for path in ("/livez", "/readyz", "/metrics", "/v1/capacity", "/v1/formats"):
            walk(200, "GET", path)
        walk(429, "PUT", f"{CLOUDS}/large", content=bytes(QUOTA))
        walk(204, "DELETE", f"{JOBS}/{job}")
        walk(204, "DELETE", f"{CLOUDS}/door")
        walk(404, "GET", f"{CLOUDS}/door")
        assert walk.walked == ROUTES


def _walk_clouds(walk: Walk) -> None:
    assert walk(200, "PUT", f"{CLOUDS}/door", content=CLOUD).json()["size"] == len(CLOUD)
    walk(201, "POST", CLOUDS, content=CLOUD)
    assert len(walk(200, "GET", CLOUDS).json()["items"]) == 2
    walk(200, "GET", f"{CLOUDS}/door")
    file = {"sha256": hashlib.sha256(CLOUD).hexdigest(), "size": len(CLOUD)}
    begun = walk.client.post(f"{CLOUDS}/presign", json=file)
    if begun.status_code == 409:  # callers do not reach the files of a directory
        for path in ("presign", "presign/x", "door/presign"):
            walk(409, "POST", f"{CLOUDS}/{path}", json=file)
        return
    place = walk(201, "POST", f"{CLOUDS}/presign", json=file)
    httpx.put(place.json()["url"], content=CLOUD, trust_env=False).raise_for_status()
    cloud = walk(200, "POST", place.headers["Location"]).json()["id"]
    url = walk(200, "POST", f"{CLOUDS}/{cloud}/presign").json()["url"]
    assert httpx.get(url, trust_env=False).content == CLOUD


def _walk_uploads(walk: Walk) -> str:
    """Id of the cloud that an upload in two pieces has become."""
    walk(204, "OPTIONS", UPLOADS, headers=TUS)
    length = {**TUS, "Upload-Length": str(len(CLOUD))}
    dropped = walk(201, "POST", UPLOADS, headers=length).headers["Location"]
    walk(204, "DELETE", dropped, headers=TUS)
    place = walk(201, "POST", UPLOADS, headers=length).headers["Location"]
    for offset, piece in ((0, CLOUD[:1000]), (1000, CLOUD[1000:])):
        found = walk(200, "HEAD", place, headers=TUS).headers["Upload-Offset"]
        assert found == str(offset)
        walk(204, "PATCH", place, headers={**PIECE, "Upload-Offset": found}, content=piece)
    return str(place.rpartition("/")[2])


def _walk_job(walk: Walk, job: str) -> None:
    assert [each["id"] for each in walk(200, "GET", JOBS).json()["items"]] == [job[len(JOBS) + 1 :]]
    assert walk(200, "GET", job).json()["result"]["confidence"] > 0
    assert walk(200, "GET", f"{job}/inliers").json()
    assert walk(200, "GET", f"{job}/aligned?format=ply").content.startswith(b"ply")
    assert walk(200, "GET", f"{job}/deviation").json()["count"] > 0
    assert walk(200, "GET", f"{job}/preview?role=source").content
    assert walk(200, "GET", f"{job}/preview.png").content.startswith(b"\x89PNG")
    assert "<html" in walk(200, "GET", f"{job}/report").text
    assert "succeeded" in walk(200, "GET", f"{job}/events").text
    walk(202, "POST", f"{job}/deliveries")
    assert walk(200, "GET", f"{job}/deliveries").json()
