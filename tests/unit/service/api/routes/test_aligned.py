"""Aligned files are written for those alone who do not have them."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest

from service.clouds.inputs import CloudInput
from service.jobs.model import JobRow, Outcome
from service.runtime import Runtime
from service.settings import Settings
from service.workers.exporter import ExportedFile
from service.workers.task import FileTask, TaskEnvironment
from tests.factories.api import on_api
from tests.factories.jobs import LEASE_S, new_job


def add_finished(runtime: Runtime) -> str:
    """Id of a registration whose result and clouds are stored."""
    cloud = runtime.blobs.put([b"cloud"])
    result = runtime.blobs.put([json.dumps({"transform": [[1.0]]}).encode()])
    source = CloudInput(cloud.sha256, cloud.size)
    job = runtime.submit(new_job(tenant="default", source=source, target=source))
    claimed = runtime.transitions.claim("register", lease_s=LEASE_S)
    assert claimed is not None
    outcome = Outcome(result.sha256, cloud.sha256, 1, 0.9, source, source, {}, [])
    assert runtime.transitions.succeed(claimed, outcome, None)
    return job.id


@pytest.fixture
def exports(tmp_path: Path) -> list[str]:
    """Formats of the files that were written."""
    return []


def test_a_known_file_is_not_written_again(tmp_path: Path, exports: list[str]) -> None:
    @contextmanager
    def export(
        job: JobRow, make_task: Callable[[TaskEnvironment], FileTask]
    ) -> Iterator[ExportedFile]:
        settings = Settings(data_dir=tmp_path)
        task = make_task(
            TaskEnvironment.create(
                job_id=job.id, tenant=job.tenant, scratch=tmp_path, settings=settings
            )
        )
        exports.append(task.output.suffix[1:])
        task.output.write_bytes(b"0123456789")
        yield ExportedFile(task.output, ())

    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        url = f"/v1/registrations/{add_finished(runtime)}/aligned"
        runtime.exporter.export = export  # type: ignore[method-assign]

        async def get(query: str = "", method: str = "GET", **headers: Any) -> httpx.Response:
            names = {name.replace("_", "-"): value for name, value in headers.items()}
            return await client.request(method, url + query, headers=names)

        whole = await get()
        tag = whole.headers["ETag"]
        assert (whole.content, exports) == (b"0123456789", ["ply"])
        for method in ("GET", "HEAD"):
            known = await get(method=method, If_None_Match=f'"other", {tag}')
            assert (known.status_code, known.content, known.headers["ETag"]) == (304, b"", tag)
        assert exports == ["ply"]
        assert (await get("?format=xyz", If_None_Match=tag)).status_code == 200
        assert (await get("?merged=true", If_None_Match=tag)).status_code == 200
        head = await get(method="HEAD")
        assert (head.status_code, head.content, head.headers["Content-Length"]) == (200, b"", "10")
        assert (await get(Range="bytes=2-4")).content == b"234"
        assert (await get(Range="bytes=2-4", If_Range=tag)).content == b"0123456789"
        beyond = await get(Range="bytes=10-")
        assert (beyond.status_code, beyond.json()["status"]) == (416, 416)

    on_api(tmp_path / "data", use)
