"""Every GET of the service: HEAD, ETag, If-None-Match and Range as RFC 9110 says."""

from __future__ import annotations

import re
from collections.abc import Awaitable, Callable
from pathlib import Path

import httpx
import pytest
from fastapi.routing import iter_route_contexts

from service.api import page, site
from service.app import create_app
from service.runtime import Runtime
from service.settings import Settings
from tests.factories.api import XYZ, on_api
from tests.factories.finished import FakeExporter, add_finished

STREAMED = {"/v1/registrations/{job_id}/events"}
"""Paths whose response comes in pieces of unknown number: no ETag."""
CHANGING = {"/metrics"}
"""Paths whose content is another each time."""
LEADING = {"/docs"}
"""Paths that lead to another."""
QUERIES = {"/v1/registrations/{job_id}/preview": "?role=source"}
PATHS = sorted(
    route.path
    for route in iter_route_contexts(create_app(Settings(data_dir=Path("/none"))).routes)
    if "GET" in (route.methods or ()) and route.path not in LEADING
)
Get = Callable[..., Awaitable[httpx.Response]]


def test_every_path_that_can_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for folder in ("page/assets", "docs"):
        (tmp_path / folder).mkdir(parents=True)
    for name in ("page/index.html", "page/assets/page.js", "docs/index.html"):
        (tmp_path / name).write_text("<p>0123456789</p>")
    monkeypatch.setattr(page, "_PAGE", tmp_path / "page")
    monkeypatch.setattr(site, "SITE", tmp_path / "docs")

    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        runtime.exporter.export = FakeExporter(tmp_path).export  # type: ignore[method-assign]
        await client.put("/v1/clouds/door", content=XYZ)
        things = {"job_id": add_finished(runtime), "cloud_id": "door", "name": "page.js"}
        for path in PATHS:
            url = re.sub(r":\w+}", "}", path).replace("{path}", "").format(**things)
            await check_path(client, path, url + QUERIES.get(path, ""))

    on_api(tmp_path / "data", use)


async def check_path(client: httpx.AsyncClient, path: str, url: str) -> None:
    async def get(method: str = "GET", **headers: str) -> httpx.Response:
        names = {name.replace("_", "-"): value for name, value in headers.items()}
        return await client.request(method, url, headers=names)

    whole = await get()
    assert whole.status_code == 200, (path, whole.text)
    await check_head(get, whole)
    if path not in STREAMED:
        await check_tag(get, whole, path)
    await check_ranges(get, whole)


async def check_head(get: Get, whole: httpx.Response) -> None:
    head = await get("HEAD")
    assert (head.status_code, head.content) == (200, b"")
    for name in ("Content-Type", "Cache-Control", "Content-Disposition", "Accept-Ranges"):
        assert head.headers.get(name) == whole.headers.get(name), whole.url


async def check_tag(get: Get, whole: httpx.Response, path: str) -> None:
    tag = whole.headers["ETag"]
    if path not in CHANGING:
        for method in ("GET", "HEAD"):
            known = await get(method, If_None_Match=f'"other", {tag}')
            assert (known.status_code, known.content, known.headers["ETag"]) == (304, b"", tag)
    assert (await get(If_None_Match='"other"')).status_code == 200


async def check_ranges(get: Get, whole: httpx.Response) -> None:
    """Files are given in parts, and documents as a whole; what is wrong is a problem document."""
    is_file = whole.headers.get("Accept-Ranges") == "bytes"
    part = await get(Range="bytes=2-4")
    assert part.status_code == (206 if is_file else 200), whole.url
    for wanted in ("bytes=9-1", "lines=1-2", "bytes=", "bytes=a-b"):
        assert (await get(Range=wanted)).status_code == 200
    beyond = await get(Range="bytes=99999-")
    if is_file:
        assert part.content == whole.content[2:5]
        assert beyond.status_code == 416
        assert beyond.headers["Content-Type"] == "application/problem+json"
        assert beyond.headers["Content-Range"] == f"bytes */{len(whole.content)}"
