"""A service that cannot start leaves nothing behind."""

from __future__ import annotations

import asyncio
import fcntl
from pathlib import Path

import pytest

from service.runtime import open_runtime
from service.settings import Settings
from service.telemetry.metrics import Metrics
from service.workers.pool import WorkerPool


async def start(data_dir: Path) -> None:
    with open_runtime(Settings(data_dir=data_dir), Metrics()):
        raise AssertionError("it has started")


def test_a_directory_that_another_service_uses_is_refused(tmp_path: Path) -> None:
    with (tmp_path / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        with pytest.raises(RuntimeError, match="MPE_DATA_DIR"):
            asyncio.run(start(tmp_path))


def test_a_start_that_fails_gives_the_directory_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_: WorkerPool) -> None:
        raise OSError("no process")

    monkeypatch.setattr(WorkerPool, "start", fail)
    for _ in range(2):
        with pytest.raises(OSError, match="no process"):
            asyncio.run(start(tmp_path))
