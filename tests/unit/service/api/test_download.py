"""Ranges of files."""

from __future__ import annotations

import asyncio
from pathlib import Path

import httpx
import pytest
from fastapi import FastAPI

from service.api.download import DownloadResponse
from service.api.error_handlers import register_error_handlers
from service.telemetry.metrics import Metrics


@pytest.mark.parametrize(
    ("wanted", "status", "content"),
    [
        ("bytes=1-3", 206, b"123"),
        ("bytes=7-", 206, b"789"),
        ("bytes=3-1", 200, b"0123456789"),
        ("lines=1-2", 200, b"0123456789"),
        ("bytes=x", 200, b"0123456789"),
        ("bytes=10-", 416, None),
        ("bytes=0-0" + ",2-2" * 3000, 200, b"0123456789"),  # each would be a part of its own
    ],
)
def test_a_range(tmp_path: Path, wanted: str, status: int, content: bytes | None) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"0123456789")
    app = FastAPI()
    register_error_handlers(app, Metrics())
    app.add_api_route("/", lambda: DownloadResponse(path), response_model=None)

    async def run() -> httpx.Response:
        transport = httpx.ASGITransport(app)
        async with httpx.AsyncClient(transport=transport, base_url="http://localhost") as client:
            return await client.get("/", headers={"Range": wanted})

    response = asyncio.run(run())
    assert response.status_code == status
    if content is not None:
        assert response.content == content
        return
    assert response.headers["Content-Range"] == "bytes */10"
    assert response.headers["Content-Type"] == "application/problem+json"
    assert response.json()["status"] == 416
