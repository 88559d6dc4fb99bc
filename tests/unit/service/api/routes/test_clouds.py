"""Clouds over HTTP: stored, replaced, listed, deleted."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from tests.factories.api import XYZ, api_client

PATH = "/v1/clouds"


def test_the_life_of_a_cloud(tmp_path: Path) -> None:
    async def run() -> None:
        async with api_client(tmp_path) as (client, _):
            stored = await client.post(PATH, content=XYZ)
            assert stored.status_code == 201
            url = stored.headers["Location"]
            assert (await client.get(url)).json() == stored.json()
            replaced = await client.put(url, content=XYZ + b"1 1 1\n")
            assert replaced.json()["size"] == len(XYZ) + 6
            assert replaced.json()["id"] == stored.json()["id"]
            await client.put(f"{PATH}/second", content=XYZ)
            page = (await client.get(PATH, params={"limit": 1})).json()
            assert [cloud["id"] for cloud in page["items"]] == ["second"]
            rest = await client.get(PATH, params={"cursor": page["next_cursor"]})
            assert rest.json() == {"items": [replaced.json()], "next_cursor": None}
            assert (await client.delete(url)).status_code == 204
            assert (await client.get(url)).status_code == 404
            assert (await client.delete(url)).status_code == 404

    asyncio.run(run())


@pytest.mark.parametrize(
    ("content", "query", "status"),
    [
        (b"", {}, 422),
        (b"\x89PNG", {}, 422),
        (b"\x89PNG", {"format": "kitti"}, 201),
        (XYZ, {"format": "jpeg"}, 422),
        (bytes(1001), {}, 413),
    ],
)
def test_what_is_taken_for_a_cloud(
    tmp_path: Path, content: bytes, query: dict[str, str], status: int
) -> None:
    async def run() -> None:
        async with api_client(tmp_path, max_body_bytes=1000) as (client, _):
            response = await client.post(PATH, content=content, params=query)
            assert response.status_code == status

    asyncio.run(run())
