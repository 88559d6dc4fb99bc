"""Long polls: notifications end them, not polling; each within its time."""

from __future__ import annotations

import asyncio
import io
import time
from pathlib import Path
from uuid import uuid4

import numpy as np
import pytest

from mpe_core import RegistrationOptions
from service.api.long_poll import wait_until_ended
from service.auth.keys import DEFAULT_TENANT
from service.clouds.inputs import CloudInput
from service.database.sqlite import SqliteDatabase
from service.jobs.model import JobRow
from service.runtime import Runtime, open_runtime
from service.settings import Settings
from service.telemetry.metrics import Metrics
from tests.factories.api import idle_runtime
from tests.factories.clouds import knot
from tests.factories.jobs import TENANT, new_job

PATIENCE_S = 240.0
"""Far longer than a start and a registration take, far shorter than until the next look."""


def test_the_end_is_announced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(SqliteDatabase, "poll_interval_s", 10 * PATIENCE_S)

    async def wait() -> str:
        with open_runtime(Settings(data_dir=tmp_path), Metrics()) as service:
            job_id = _added(service)
            waiting = wait_until_ended(service, DEFAULT_TENANT, job_id, 10 * PATIENCE_S)
            job = await asyncio.wait_for(waiting, PATIENCE_S)
            assert job is not None
            return job.status

    assert asyncio.run(wait()) == "succeeded"


def _added(service: Runtime) -> str:
    file = io.BytesIO()
    np.save(file, knot(300, np.random.default_rng(0)))
    blob = service.blobs.put([file.getvalue()])
    cloud = CloudInput(blob.sha256, blob.size)
    job = JobRow(
        id=str(uuid4()),
        tenant=DEFAULT_TENANT,
        source=cloud,
        target=cloud,
        options={name: getattr(RegistrationOptions(), name) for name in ("method", "seed")},
        created_at=time.time(),
    )
    service.submit(job)
    return job.id


@pytest.mark.parametrize("tenant", ["other", "nobody"])
def test_what_does_not_exist_is_not_waited_for(tmp_path: Path, tenant: str) -> None:
    async def wait() -> JobRow | None:
        with idle_runtime(tmp_path) as runtime:
            job = runtime.submit(new_job(tenant="lab"))
            return await asyncio.wait_for(
                wait_until_ended(runtime, tenant, job.id, 10 * PATIENCE_S), PATIENCE_S
            )

    assert asyncio.run(wait()) is None


def test_the_job_as_it_is_after_the_wait(tmp_path: Path) -> None:
    async def wait() -> JobRow | None:
        with idle_runtime(tmp_path) as runtime:
            job = runtime.submit(new_job())
            return await wait_until_ended(runtime, TENANT, job.id, 0.05)

    job = asyncio.run(wait())
    assert job is not None
    assert job.status == "queued"


@pytest.mark.parametrize("how", ["cancelled", "removed", "stopped"])
def test_what_ends_a_wait(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, how: str) -> None:
    monkeypatch.setattr(SqliteDatabase, "poll_interval_s", 10 * PATIENCE_S)

    def end(runtime: Runtime, job: JobRow) -> None:
        if how == "stopped":
            runtime.drain()
        else:
            runtime.cancel(job.id)
        if how == "removed":
            runtime.transitions.remove(job.id)

    async def wait() -> str | None:
        with idle_runtime(tmp_path) as runtime:
            job = runtime.submit(new_job())
            asyncio.get_running_loop().call_later(0.05, end, runtime, job)
            waiting = wait_until_ended(runtime, TENANT, job.id, 10 * PATIENCE_S)
            found = await asyncio.wait_for(waiting, PATIENCE_S)
            return None if found is None else found.status

    expected = {"cancelled": "cancelled", "removed": None, "stopped": "queued"}
    assert asyncio.run(wait()) == expected[how]
