"""Clouds that the service fetches from a real HTTP server beside it."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from tests.e2e.scans import arms, as_npy
from tests.server import Server, running_server

CLOUD = as_npy(arms(1))


class Files(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        if self.path == "/cloud.npy":
            self._answer(200, CLOUD)
        elif self.path == "/moved":
            self._answer(302, b"", Location="/cloud.npy")
        elif self.path == "/endless":
            self._answer(200, bytes(1 << 20))
        else:
            self._answer(404, b"nothing here")

    def _answer(self, status: int, body: bytes, **headers: str) -> None:
        self.send_response(status)
        for name, value in headers.items():
            self.send_header(name, value)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture(scope="module")
def files() -> Iterator[str]:
    with ThreadingHTTPServer(("127.0.0.1", 0), Files) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


@pytest.fixture(scope="module")
def fetching(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    directory = tmp_path_factory.mktemp("fetching")
    with running_server(directory, url_hosts="127.0.0.1", max_body_bytes=500_000) as server:
        yield server


def request(source: str, target: str) -> dict[str, object]:
    return {"source": {"url": source}, "target": {"url": target}, "options": {"seed": 3}}


def test_both_clouds_are_fetched(fetching: Server, files: str) -> None:
    response = fetching.client.post(
        "/v1/registrations",
        json=request(f"{files}/cloud.npy", f"{files}/cloud.npy"),
        headers={"Prefer": "wait=30"},
    )
    job = response.json()
    assert response.status_code == 200, job
    assert job["status"] == "succeeded"
    assert job["source"]["size"] == len(CLOUD)
    assert job["options"]["seed"] == 3
    assert job["timing"]["fetch_s"] > 0
    assert job["result"]["overlap"] == 1


@pytest.mark.parametrize(
    ("path", "word"), [("/missing", "404"), ("/moved", "302"), ("/endless", "500000 bytes")]
)
def test_what_cannot_be_fetched_is_explained(
    fetching: Server, files: str, path: str, word: str
) -> None:
    response = fetching.client.post(
        "/v1/registrations",
        json=request(files + path, f"{files}/cloud.npy"),
        headers={"Prefer": "wait=30"},
    )
    assert response.status_code == 422
    assert response.json()["type"] == "urn:mpe:problem:fetch-failed"
    assert word in response.json()["detail"]


@pytest.mark.parametrize(
    ("url", "status"),
    [
        ("http://localhost:1/cloud.npy", 403),
        ("http://user:word@127.0.0.1/cloud.npy", 403),
        ("file:///etc/passwd", 422),
        ("cloud.npy", 422),
    ],
)
def test_other_addresses_are_refused(fetching: Server, files: str, url: str, status: int) -> None:
    response = fetching.client.post("/v1/registrations", json=request(url, f"{files}/cloud.npy"))
    assert response.status_code == status
    assert "passwd" not in response.text


def test_nothing_is_fetched_unless_a_host_is_named(server: Server, files: str) -> None:
    response = server.client.post(
        "/v1/registrations", json=request(f"{files}/cloud.npy", f"{files}/cloud.npy")
    )
    assert response.status_code == 403
    assert response.json()["type"] == "urn:mpe:problem:address-refused"
    assert "MPE_URL_HOSTS" in response.json()["detail"]
