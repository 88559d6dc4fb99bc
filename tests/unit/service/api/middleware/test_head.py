"""HEAD gives the status and headers of GET, and no body."""

from __future__ import annotations

from pathlib import Path

import httpx
import pytest

from service.runtime import Runtime
from tests.factories.api import XYZ, on_api


@pytest.mark.parametrize(
    "path",
    ["/livez", "/v1/formats", "/v1/clouds/door", "/v1/clouds/none", "/openapi.json", "/none"],
)
def test_head_is_get_without_a_body(tmp_path: Path, path: str) -> None:
    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        await client.put("/v1/clouds/door", content=XYZ)
        got, looked = await client.get(path), await client.head(path)
        assert looked.status_code == got.status_code
        assert looked.content == b""
        for name in ("content-type", "content-length", "cache-control"):
            assert looked.headers.get(name) == got.headers.get(name)

    on_api(tmp_path, use)


def test_head_of_what_has_no_get_is_refused_or_its_own(tmp_path: Path) -> None:
    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        refused = await client.head("/v1/uploads")
        assert (refused.status_code, refused.headers["Allow"]) == (405, "OPTIONS, POST")
        assert (await client.head("/v1/uploads/none")).status_code == 412

    on_api(tmp_path, use)


def test_a_slash_more_is_another_path(tmp_path: Path) -> None:
    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        answer = await client.get("/v1/clouds/", headers={"Host": "evil.example.org"})
        assert answer.status_code == 404

    on_api(tmp_path, use)


def test_invented_methods_are_one_label(tmp_path: Path) -> None:
    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        for number in range(50):
            assert (await client.request(f"M{number}", "/livez")).status_code == 405
        text = (await client.get("/metrics")).text
        assert "M1" not in text

    on_api(tmp_path, use)
