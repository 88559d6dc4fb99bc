"""Clouds that are stored once, uploaded whole or in pieces, and referred to."""

from __future__ import annotations

import io
import json
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from tusclient.client import TusClient
from tusclient.uploader import Uploader

from tests.factories.clouds import knot
from tests.factories.scans import arms, as_npy, motion, moved, pose_error
from tests.factories.server import Server, running_server
from tests.factories.waiting import until

REFERENCE = arms(1)
FILE = as_npy(REFERENCE)
TUS = {"Tus-Resumable": "1.0.0"}


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """Of this file alone: it is killed, and decodes a file for the first time."""
    with running_server(tmp_path_factory.mktemp("server")) as running:
        yield running


def as_text(rows: int) -> bytes:
    text = io.StringIO()
    np.savetxt(text, knot(rows, np.random.default_rng(3)), fmt="%.7f")
    return text.getvalue().encode()


def put(server: Server, cloud_id: str, file: bytes) -> dict[str, Any]:
    response = server.client.put(f"/v1/clouds/{cloud_id}", content=file)
    assert response.status_code == 200, response.text
    return dict(response.json())


def registered(response: httpx.Response) -> dict[str, Any]:
    assert response.status_code == 200, response.text
    assert response.json()["status"] == "succeeded", response.text
    return dict(response.json())


def test_many_scans_against_one_reference(server: Server) -> None:
    created = server.client.post("/v1/clouds", content=FILE)
    assert created.status_code == 201
    cloud = created.json()
    assert created.headers["Location"] == f"/v1/clouds/{cloud['id']}"
    assert (cloud["size"], cloud["format"]) == (len(FILE), "npy")
    for seed in range(3):
        truth = motion(np.random.default_rng(seed), REFERENCE, 20, 0.2)
        scan = as_npy(moved(np.linalg.inv(truth), REFERENCE))
        response = server.client.post(
            "/v1/registrations",
            files={"source": scan},
            data={"target": json.dumps({"cloud": cloud["id"]})},
            headers={"Prefer": "wait=60"},
        )
        job = registered(response)
        assert job["target"]["cloud"] == cloud["id"]
        degrees, _ = pose_error(np.array(job["result"]["transform"]), truth, REFERENCE)
        assert degrees < 0.1
    used = server.client.get(f"/v1/clouds/{cloud['id']}").json()
    assert used["expires_at"] > cloud["expires_at"]


def test_a_reference_is_decoded_once(server: Server) -> None:
    put(server, "big-text", as_text(100_000))
    reference = {"cloud": "big-text"}
    decode_s = []
    for seed in range(4):
        request = {"source": reference, "target": reference, "options": {"seed": seed}}
        response = server.client.post(
            "/v1/registrations", json=request, headers={"Prefer": "wait=60"}
        )
        decode_s.append(registered(response)["timing"]["decode_s"])
    first, again = decode_s[0], min(decode_s[1:])
    print(f"decoding 100,000 lines of text: {first:.3f} s, again {again:.4f} s")
    assert again < first / 2


def test_clouds_are_listed_replaced_and_removed(server: Server) -> None:
    first = put(server, "ring", FILE)
    second = put(server, "ring", as_npy(arms(2)))
    assert first["sha256"] != second["sha256"]
    put(server, "rod", FILE)
    page = server.client.get("/v1/clouds", params={"limit": 1}).json()
    following = server.client.get(
        "/v1/clouds", params={"limit": 1, "cursor": page["next_cursor"]}
    ).json()
    assert [item["id"] for item in page["items"] + following["items"]] == ["rod", "ring"]
    assert server.client.delete("/v1/clouds/ring").status_code == 204
    assert server.client.get("/v1/clouds/ring").status_code == 404
    assert server.client.delete("/v1/clouds/ring").status_code == 404


def test_references_that_are_wrong(server: Server) -> None:
    for reference, status in (
        ({"cloud": "nobody"}, 404),
        ({}, 422),
        ({"cloud": "a", "url": "http://a"}, 422),
        ({"clud": "a"}, 422),
    ):
        request = {"source": reference, "target": reference}
        assert server.client.post("/v1/registrations", json=request).status_code == status
    for content, status in ((b"", 422), (b"\x89PNG\r\n", 422)):
        assert server.client.post("/v1/clouds", content=content).status_code == status
    assert server.client.put("/v1/clouds/a%20b", content=FILE).status_code == 422


def uploader(server: Server, content: bytes, **kwargs: Any) -> Uploader:
    client = TusClient(f"{server.url}/v1/uploads")
    return client.uploader(file_stream=io.BytesIO(content), chunk_size=100_000, **kwargs)


def test_upload_by_a_client_of_the_protocol(server: Server) -> None:
    content = as_npy(arms(4, 50_000))
    upload = uploader(server, content)
    upload.upload()
    cloud = server.client.get(f"/v1/clouds/{upload.url.rsplit('/', 1)[1]}").json()
    assert cloud["size"] == len(content)


def test_upload_goes_on_after_a_cut_and_a_crash(server: Server) -> None:
    content = as_npy(arms(5, 50_000))
    first = uploader(server, content)
    first.upload_chunk()
    assert first.offset == 100_000
    cut_connection(server, first.url, content, offset=100_000, sent=50_000)
    server.kill()
    server.start()
    second = uploader(server, content, url=first.url)
    assert second.offset == 150_000
    second.upload()
    name = first.url.rsplit("/", 1)[1]
    blob = server.client.get(f"/v1/clouds/{name}").json()["sha256"]
    assert (server.data_dir / "blobs" / blob[:2] / blob).read_bytes() == content


def cut_connection(server: Server, url: str, content: bytes, *, offset: int, sent: int) -> None:
    """Announce the rest of the file, send a part of it, and hang up when that has come."""
    path = url.removeprefix(server.url)
    head = (
        f"PATCH {path} HTTP/1.1\r\nHost: localhost\r\n"
        f"Tus-Resumable: 1.0.0\r\nUpload-Offset: {offset}\r\n"
        "Content-Type: application/offset+octet-stream\r\n"
        f"Content-Length: {len(content) - offset}\r\n\r\n"
    )
    with socket.create_connection(("127.0.0.1", server.port)) as connection:
        connection.sendall(head.encode() + content[offset : offset + sent])
        until(
            lambda: (
                server.client.head(path, headers=TUS).headers["Upload-Offset"] == str(offset + sent)
            )
        )


def test_the_rules_of_tus(server: Server) -> None:
    client = server.client
    described = client.options("/v1/uploads")
    assert described.status_code == 204
    assert described.headers["Tus-Version"] == "1.0.0"
    assert "creation" in described.headers["Tus-Extension"]
    assert client.post("/v1/uploads", headers={"Upload-Length": "9"}).status_code == 412
    too_long = TUS | {"Upload-Length": str(10**15)}
    assert client.post("/v1/uploads", headers=too_long).status_code == 413
    url = client.post("/v1/uploads", headers=TUS | {"Upload-Length": "9"}).headers["Location"]
    piece = TUS | {"Content-Type": "application/offset+octet-stream"}

    def patch(offset: int, content: bytes, **headers: str) -> int:
        sent = piece | {"Upload-Offset": str(offset)} | headers
        return client.patch(url, headers=sent, content=content).status_code

    assert patch(1, b"0 0 0") == 409
    assert patch(0, b"0 0 0\n0 0 1\n") == 413
    assert patch(0, b"0 0 0", **{"Content-Type": "text/plain"}) == 415
    assert patch(0, b"0 0 0") == 204
    looked = client.head(url, headers=TUS)
    assert (looked.headers["Upload-Offset"], looked.headers["Upload-Length"]) == ("5", "9")
    assert looked.headers["Cache-Control"] == "no-store"
    assert client.delete(url, headers=TUS).status_code == 204
    assert client.head(url, headers=TUS).status_code == 404


def test_an_upload_that_is_no_cloud_is_dropped(server: Server) -> None:
    url = server.client.post("/v1/uploads", headers=TUS | {"Upload-Length": "8"}).headers[
        "Location"
    ]
    piece = {"Content-Type": "application/offset+octet-stream", "Upload-Offset": "0"}
    response = server.client.patch(url, headers=TUS | piece, content=b"\x89PNG\r\n\x1a\n")
    assert response.status_code == 422
    assert server.client.head(url, headers=TUS).status_code == 404


@pytest.fixture
def forgetful(tmp_path: Path) -> Iterator[Server]:
    with running_server(
        tmp_path,
        upload_retention_s=1,
        cloud_retention_s=1,
        blob_grace_s=2,
        maintenance_interval_s=0.2,
    ) as server:
        yield server


def test_abandoned_uploads_and_unused_clouds_are_dropped(forgetful: Server) -> None:
    client = forgetful.client
    url = client.post("/v1/uploads", headers=TUS | {"Upload-Length": "9"}).headers["Location"]
    put(forgetful, "ring", FILE)
    kept = [forgetful.data_dir / name for name in ("uploads", "blobs", "prepared")]
    until(lambda: not any(p.is_file() for directory in kept for p in directory.rglob("*")))
    assert client.head(url, headers=TUS).status_code == 404
    assert client.get("/v1/clouds/ring").status_code == 404


def test_a_format_that_the_content_does_not_tell_is_declared(server: Server) -> None:
    rows = np.column_stack([REFERENCE, np.zeros(len(REFERENCE))]).astype("<f4").tobytes()
    assert server.client.post("/v1/clouds", content=rows).status_code == 422
    unknown = server.client.post("/v1/clouds?format=docx", content=rows)
    assert unknown.status_code == 422
    assert "expected one of" in unknown.json()["detail"]
    stored = server.client.put("/v1/clouds/street?format=kitti", content=rows)
    assert stored.json()["format"] == "kitti"
    begun = server.client.post(
        "/v1/uploads?format=kitti", headers=TUS | {"Upload-Length": str(len(rows))}
    )
    piece = {"Upload-Offset": "0", "Content-Type": "application/offset+octet-stream"}
    server.client.patch(begun.headers["Location"], content=rows, headers=TUS | piece)
    uploaded = begun.headers["Location"].rpartition("/")[2]
    for name in ("street", uploaded):
        response = server.client.post(
            "/v1/registrations",
            files={"source": FILE},
            data={"target": json.dumps({"cloud": name})},
            headers={"Prefer": "wait=60"},
        )
        job = registered(response)
        assert job["target"]["reading"] == {"format": "kitti"}
        degrees, _ = pose_error(np.array(job["result"]["transform"]), np.eye(4), REFERENCE)
        assert degrees < 0.1
