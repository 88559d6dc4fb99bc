"""Files that went to the store directly: read in turns, and few of a tenant wait."""

from __future__ import annotations

import asyncio
import threading
from collections import Counter
from pathlib import Path

import httpx
import pytest

from service.api.routes import direct
from service.clouds.store import StoredCloud
from service.clouds.uploads import Upload
from service.runtime import MAX_READING, Runtime
from service.workers.tenant_gate import MAX_WAITING_PER_TENANT
from tests.factories.api import on_api

PATH = "/v1/clouds/presign/large"
CLOUD = StoredCloud("default", "large", "ab", 1, "xyz", False, 1.0, 2.0)


class SlowStore:
    """A store whose files take until `is_over` to be read."""

    def __init__(self) -> None:
        self.is_over = threading.Event()

    def get(self, tenant: str, upload_id: str) -> Upload:
        return Upload(upload_id, tenant, 1, False, 2.0, None)

    def complete(self, upload: Upload) -> StoredCloud:
        assert self.is_over.wait(20)
        return CLOUD


def test_one_more_than_may_wait_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        store = SlowStore()
        monkeypatch.setattr(direct, "require_direct", lambda _: store)
        calls = [
            asyncio.create_task(client.post(PATH))
            for _ in range(MAX_READING + MAX_WAITING_PER_TENANT + 1)
        ]
        refused, _ = await asyncio.wait(calls, return_when=asyncio.FIRST_COMPLETED, timeout=20)
        answers = [task.result() for task in refused]
        assert [answer.status_code for answer in answers] == [429]
        assert answers[0].json()["limit"] == "uploads"
        assert answers[0].headers["Retry-After"]
        store.is_over.set()
        statuses = Counter(answer.status_code for answer in await asyncio.gather(*calls))
        assert statuses == {200: len(calls) - 1, 429: 1}

    on_api(tmp_path, use)
