"""Uploads in pieces (tus): they go on where they ended, and become clouds."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from service.api.routes import uploads
from service.runtime import Runtime
from tests.factories.api import XYZ, on_api
from tests.factories.threads import note_threads

PATH = "/v1/uploads"
TUS = {"Tus-Resumable": "1.0.0"}
PIECE = TUS | {"Content-Type": "application/offset+octet-stream"}


async def begin(client: httpx.AsyncClient, length: int) -> str:
    response = await client.post(PATH, headers=TUS | {"Upload-Length": str(length)})
    assert response.status_code == 201
    return response.headers["Location"]


async def send(client: httpx.AsyncClient, url: str, offset: int, body: Any) -> httpx.Response:
    headers = PIECE | {"Upload-Offset": str(offset)}
    return await client.patch(url, headers=headers, content=body)


def test_pieces_become_a_cloud(tmp_path: Path) -> None:
    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        url = await begin(client, len(XYZ))
        first = await send(client, url, 0, XYZ[:7])
        assert (first.status_code, first.headers["Upload-Offset"]) == (204, "7")
        state = await client.head(url, headers=TUS)
        assert state.headers["Upload-Offset"] == "7"
        assert state.headers["Upload-Length"] == str(len(XYZ))
        assert (await send(client, url, 7, XYZ[7:])).headers["Upload-Offset"] == str(len(XYZ))
        cloud = await client.get(url.replace("uploads", "clouds"))
        assert (cloud.json()["size"], cloud.json()["format"]) == (len(XYZ), "xyz")
        assert (await client.delete(url, headers=TUS)).status_code == 204
        assert (await client.get(url.replace("uploads", "clouds"))).status_code == 200

    on_api(tmp_path, use)


def test_pieces_are_written_by_threads(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A disk may be slow: the event loop does not wait for it."""
    writers = note_threads(monkeypatch, uploads, "_append")

    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        url = await begin(client, len(XYZ))
        assert (await send(client, url, 0, XYZ)).status_code == 204
        assert writers
        assert threading.get_ident() not in writers

    on_api(tmp_path, use)


def test_a_piece_begins_where_the_upload_ends(tmp_path: Path) -> None:
    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        url = await begin(client, len(XYZ))
        await send(client, url, 0, XYZ[:7])
        for offset in (0, 6, 8):
            assert (await send(client, url, offset, XYZ[offset:])).status_code == 409
        await send(client, url, 7, XYZ[7:])
        assert (await send(client, url, len(XYZ), b"x")).status_code == 409

    on_api(tmp_path, use)


def test_a_piece_is_not_longer_than_the_rest(tmp_path: Path) -> None:
    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        url = await begin(client, 9)
        assert (await send(client, url, 0, bytes(10))).status_code == 413

    on_api(tmp_path, use)


def test_an_upload_that_is_no_cloud_is_removed(tmp_path: Path) -> None:
    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        url = await begin(client, 4)
        refused = await send(client, url, 0, b"\x89PNG")
        assert refused.json()["type"] == "urn:mpe:problem:unreadable-cloud"
        assert (await client.head(url, headers=TUS)).status_code == 404

    on_api(tmp_path, use)


@pytest.mark.parametrize("headers", [{}, {"Tus-Resumable": "0.2.2"}])
def test_other_versions_are_refused(tmp_path: Path, headers: dict[str, str]) -> None:
    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        refused = await client.post(PATH, headers=headers | {"Upload-Length": "9"})
        assert refused.status_code == 412
        assert refused.headers["Tus-Version"] == "1.0.0"

    on_api(tmp_path, use)


def test_what_is_supported(tmp_path: Path) -> None:
    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        headers = (await client.options(PATH)).headers
        assert headers["Tus-Version"] == "1.0.0"
        assert headers["Tus-Extension"] == "creation,expiration,termination"
        assert headers["Tus-Max-Size"] == "20"
        too_long = await client.post(PATH, headers=TUS | {"Upload-Length": "21"})
        assert too_long.status_code == 413
        wrong = await client.patch(
            await begin(client, 9), headers=TUS | {"Upload-Offset": "0"}, content=b"x"
        )
        assert wrong.status_code == 415

    on_api(tmp_path, use, max_body_bytes=20)


def test_what_arrived_before_a_cut_stays(tmp_path: Path) -> None:
    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        url = await begin(client, 9)

        async def unannounced() -> AsyncIterator[bytes]:
            yield b"123"
            yield b"45"

        assert (await send(client, url, 0, unannounced())).headers["Upload-Offset"] == "5"
        assert (await client.head(url, headers=TUS)).headers["Upload-Offset"] == "5"

    on_api(tmp_path, use)


def test_a_new_request_ends_the_silent_one_it_goes_on_from(tmp_path: Path) -> None:
    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        url = await begin(client, len(XYZ))
        silent = asyncio.Event()

        async def ghost() -> AsyncIterator[bytes]:
            yield XYZ[:7]
            silent.set()
            await asyncio.sleep(60)

        old = asyncio.create_task(send(client, url, 0, ghost()))
        await silent.wait()
        await asyncio.sleep(0.2)
        assert (await client.head(url, headers=TUS)).headers["Upload-Offset"] == "7"
        assert (await send(client, url, 3, XYZ[3:])).status_code == 409
        assert not old.done()
        assert (await send(client, url, 7, XYZ[7:])).status_code == 204
        old.cancel()
        assert (await client.get(url.replace("uploads", "clouds"))).json()["size"] == len(XYZ)

    on_api(tmp_path, use)
