"""Waits are ended by what is announced, not by looking from time to time."""

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
from tests.factories.clouds import knot

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
