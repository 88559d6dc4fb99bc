"""Everything a caller can get wrong has its own clear 4xx, and the service lives on."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import httpx
import numpy as np
import pytest

from tests.factories.scans import arms, as_npy
from tests.factories.server import Server, finished, running_server

GOOD = as_npy(arms(1))
PLY_CUT_SHORT = (
    b"ply\nformat binary_little_endian 1.0\nelement vertex 500\n"
    b"property float x\nproperty float y\nproperty float z\nend_header\n" + bytes(100)
)
LINE = np.outer(np.arange(50.0), (1, 2, 3))


@pytest.fixture(autouse=True)
def _alive(server: Server) -> Iterator[None]:
    yield
    job = server.submit(GOOD, GOOD, wait=60)
    assert job.json()["status"] == "succeeded"


def problem(response: httpx.Response, status: int, kind: str) -> dict[str, Any]:
    assert response.status_code == status, response.text
    assert response.headers["Content-Type"] == "application/problem+json"
    body: dict[str, Any] = response.json()
    assert body["status"] == status
    assert body["type"] == f"urn:mpe:problem:{kind}"
    assert body["title"]
    assert body["detail"]
    return body


@pytest.mark.parametrize(
    ("file", "kind", "word"),
    [
        (PLY_CUT_SHORT, "unreadable-cloud", "source"),
        (as_npy(np.zeros((1, 3))), "too-few-points", "source"),
        (as_npy(np.full((50, 3), np.nan)), "too-few-points", "source"),
        (as_npy(LINE), "degenerate-cloud", "source"),
        (as_npy(np.zeros((50, 2))), "unreadable-cloud", "source"),
    ],
    ids=["cut short", "one point", "only NaN", "a line", "two columns"],
)
def test_input_that_only_decoding_can_judge(
    server: Server, file: bytes, kind: str, word: str
) -> None:
    waited = server.submit(file, GOOD, wait=60)
    body = problem(waited, 422, kind)
    assert word in body["detail"]
    url = waited.headers["Location"]
    assert url.endswith(body["job"])
    job = server.client.get(url).json()
    assert job["status"] == "failed"
    assert job["error"]["type"] == body["type"]
    assert job["error"]["status"] == 422
    accepted = server.submit(file, GOOD)
    assert accepted.status_code == 202
    assert finished(server.client, accepted.json()["id"])["error"]["type"] == body["type"]


def test_empty_file(server: Server) -> None:
    body = problem(server.submit(b"", GOOD), 422, "invalid-request")
    assert "source: the file is empty" in body["detail"]


def test_file_of_no_known_format(server: Server) -> None:
    body = problem(server.submit(GOOD, b"\x89PNG\r\n\x1a\n" + bytes(99)), 422, "unreadable-cloud")
    assert "target" in body["detail"]


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ('{"methd": "mpl"}', "did you mean 'method'"),
        ('{"method": "icp"}', "'mpl' or 'mpe'"),
        ('{"overlap": 1.5}', "overlap"),
        ('{"seed": "secret-words"}', "integer"),
        ('{"overlap": NaN}', "finite"),
        ('["mpl"]', "/options"),
        ("{secret-words", "expected JSON"),
        ("[" * 100_000, "expected JSON"),
    ],
)
def test_options_that_are_wrong(server: Server, options: str, word: str) -> None:
    response = server.submit(GOOD, GOOD, options=options)
    body = problem(response, 422, "invalid-request")
    assert word in body["detail"]
    assert "secret" not in response.text


def test_unknown_form_field(server: Server) -> None:
    response = server.submit(GOOD, GOOD, optoins="{}")
    assert "did you mean 'options'" in problem(response, 422, "invalid-request")["detail"]


def test_missing_file(server: Server) -> None:
    response = server.client.post("/v1/registrations", files={"source": GOOD})
    assert "target" in problem(response, 422, "invalid-request")["detail"]


@pytest.mark.parametrize(
    ("content_type", "body", "status", "kind"),
    [
        ("text/plain", b"0 0 0", 415, "unsupported-content-type"),
        ("application/json", b"{not json", 400, "malformed-body"),
        ("application/json", b"{}", 422, "invalid-request"),
        ("multipart/form-data", b"zzz", 400, "malformed-body"),
        ("multipart/form-data; boundary=x", b"zzz", 400, "malformed-body"),
        ("multipart/form-data; boundary=x", b"--x\r\n\r\nzzz\r\n--x--", 400, "malformed-body"),
        (
            "multipart/form-data; boundary=x",
            b'--x\r\nContent-Disposition: form-data; name="source"; filename="a"\r\n\r\nzzz',
            400,
            "malformed-body",
        ),
    ],
)
def test_bodies_that_are_wrong(
    server: Server, content_type: str, body: bytes, status: int, kind: str
) -> None:
    response = server.client.post(
        "/v1/registrations", content=body, headers={"Content-Type": content_type}
    )
    problem(response, status, kind)


def test_no_content_type(server: Server) -> None:
    problem(server.client.post("/v1/registrations"), 415, "unsupported-content-type")


@pytest.mark.parametrize(
    ("method", "path", "status", "kind"),
    [
        ("GET", "/v1/nothing", 404, "not-found"),
        ("GET", "/v1/registrations/nobody", 404, "unknown-registration"),
        ("GET", "/v1/registrations/nobody/inliers", 404, "unknown-registration"),
        ("DELETE", "/v1/registrations/nobody", 404, "unknown-registration"),
        ("PUT", "/v1/registrations", 405, "method-not-allowed"),
        ("GET", "/v1/registrations?limit=0", 422, "invalid-request"),
        ("GET", "/v1/registrations?limit=many", 422, "invalid-request"),
    ],
)
def test_requests_that_are_wrong(
    server: Server, method: str, path: str, status: int, kind: str
) -> None:
    problem(server.client.request(method, path), status, kind)


def test_body_over_the_limit(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Announced or not, it is refused, and nothing of it stays on the disk."""
    with running_server(tmp_path_factory.mktemp("small"), max_body_bytes=100_000) as server:
        problem(server.submit(bytes(200_000), GOOD), 413, "body-too-large")

        def unannounced() -> Iterator[bytes]:
            yield b'--x\r\nContent-Disposition: form-data; name="source"; filename="a"\r\n\r\n'
            for _ in range(20):
                yield bytes(10_000)

        response = server.client.post(
            "/v1/registrations",
            content=unannounced(),
            headers={"Content-Type": "multipart/form-data; boundary=x"},
        )
        problem(response, 413, "body-too-large")
        stored = [path for path in server.data_dir.rglob("*") if path.is_file()]
        kept = {path.name.partition(".")[0] for path in stored}
        assert kept <= {"jobs", "lock", "reserve", "scratch", "store"}  # and nothing of the body
        assert server.submit(GOOD, GOOD, wait=60).json()["status"] == "succeeded"
