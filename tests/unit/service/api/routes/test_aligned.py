"""Aligned files are written for those alone who do not have them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import httpx

from service.runtime import Runtime
from tests.factories.api import on_api
from tests.factories.finished import EXPORTED, FakeExporter, add_finished


def test_a_known_file_is_not_written_again(tmp_path: Path) -> None:
    exporter = FakeExporter(tmp_path)

    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        url = f"/v1/registrations/{add_finished(runtime)}/aligned"
        runtime.exporter.export = exporter.export  # type: ignore[method-assign]

        async def get(query: str = "", method: str = "GET", **headers: Any) -> httpx.Response:
            names = {name.replace("_", "-"): value for name, value in headers.items()}
            return await client.request(method, url + query, headers=names)

        whole = await get()
        tag = whole.headers["ETag"]
        assert (whole.content, exporter.written) == (EXPORTED, ["aligned.ply"])
        for method in ("GET", "HEAD"):
            known = await get(method=method, If_None_Match=f'"other", {tag}')
            assert (known.status_code, known.content, known.headers["ETag"]) == (304, b"", tag)
        assert exporter.written == ["aligned.ply"]
        assert (await get("?format=xyz", If_None_Match=tag)).status_code == 200
        assert (await get("?merged=true", If_None_Match=tag)).status_code == 200
        assert (await get(Range="bytes=2-4", If_Range=tag)).content == EXPORTED

    on_api(tmp_path / "data", use)
