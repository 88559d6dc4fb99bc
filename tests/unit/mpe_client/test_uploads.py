"""Uploads go on where they broke."""

from __future__ import annotations

import io
import re

import httpx
import pytest

from mpe_client import uploads
from mpe_client.errors import ProblemError
from mpe_client.transport import run_blocking
from tests.factories.fake_service import blocking_core, problem

CONTENT = bytes(range(256)) * 40
CLOUD = {
    "id": "u1", "sha256": "0", "size": len(CONTENT), "format": "xyz",
    "created_at": "2026-01-05T09:30:00Z", "expires_at": "2026-01-05T09:30:00Z",
}  # fmt: skip


class Tus:
    """Keeps half of each second piece, and breaks the connection."""

    def __init__(self) -> None:
        self.kept, self.pieces, self.heads = b"", 0, 0

    def __call__(self, request: httpx.Request) -> httpx.Response:
        if request.method == "POST":
            assert int(request.headers["Upload-Length"]) == len(CONTENT)
            return httpx.Response(201, headers={"Location": "/v1/uploads/u1"})
        if request.method == "HEAD":
            self.heads += 1
            return httpx.Response(200, headers={"Upload-Offset": str(len(self.kept))})
        if request.method == "GET":
            return httpx.Response(200, json=CLOUD)
        if int(request.headers["Upload-Offset"]) != len(self.kept):
            return problem(409, "upload-conflict")
        self.pieces += 1
        piece = request.read()
        if self.pieces % 2 == 0:
            self.kept += piece[: len(piece) // 2]
            raise httpx.WriteError("reset")
        self.kept += piece
        return httpx.Response(204, headers={"Upload-Offset": str(len(self.kept))})


@pytest.fixture(autouse=True)
def _small_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(uploads, "PIECE_BYTES", 1000)


def test_a_broken_upload_goes_on_where_it_broke() -> None:
    service = Tus()
    cloud = run_blocking(blocking_core(service).upload(io.BytesIO(CONTENT), None))
    assert (cloud.id, service.kept) == ("u1", CONTENT)
    assert service.heads >= 3


def test_a_refused_upload_is_not_repeated() -> None:
    def refuse(request: httpx.Request) -> httpx.Response:
        return problem(413, "body-too-large")

    with pytest.raises(ProblemError, match=re.escape("(413)")):
        run_blocking(blocking_core(refuse).upload(io.BytesIO(CONTENT), None))


def test_a_url_is_not_uploaded() -> None:
    with pytest.raises(TypeError, match="a URL is not uploaded"):
        run_blocking(blocking_core(Tus()).upload("https://host/a.ply", None))
