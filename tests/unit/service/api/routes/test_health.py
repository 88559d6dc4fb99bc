"""Probes answer whatever the shared threads do."""

from __future__ import annotations

import asyncio
import shutil
import threading
from pathlib import Path
from unittest import mock

import httpx
import pytest
from anyio import to_thread

from service.api.routes import health
from service.jobs.missing_workers import MissingWorkers
from service.runtime import Runtime
from tests.factories.api import on_api


def test_probes_wait_for_no_shared_thread(tmp_path: Path) -> None:
    release = threading.Event()

    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        busy = [asyncio.create_task(to_thread.run_sync(release.wait, 20)) for _ in range(50)]
        await asyncio.sleep(0.05)
        try:
            async with asyncio.timeout(10):
                for path in ("/livez", "/readyz"):
                    assert (await client.get(path)).status_code == 200
        finally:
            release.set()
            await asyncio.gather(*busy)

    on_api(tmp_path, use)


@pytest.mark.parametrize(("owner", "name"), [(MissingWorkers, "describe"), (shutil, "disk_usage")])
def test_what_does_not_answer_is_not_ready(
    owner: object, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A database, or a disk on another machine; the loop does not wait for either."""
    monkeypatch.setattr(health, "ANSWER_S", 0.05)
    release = threading.Event()

    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        def hang(*_: object) -> None:
            release.wait(20)

        with mock.patch.object(owner, name, hang):
            assert (await client.get("/readyz")).status_code == 503
            assert (await client.get("/livez")).status_code == 200
            release.set()
        assert (await client.get("/readyz")).status_code == 200

    on_api(tmp_path, use)
