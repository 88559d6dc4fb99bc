"""A service that cannot start leaves nothing behind; one that begins to lead waits a moment."""

from __future__ import annotations

import asyncio
import fcntl
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import pytest

from service.runtime import LEADER_PAUSE, _urgent_tasks, open_runtime
from service.settings import Settings
from service.telemetry.metrics import Metrics
from service.workers.lease import HEARTBEAT_SHARE
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


@pytest.mark.parametrize(("led", "is_ended"), [(0.0, False), (0.9, False), (1.1, True)])
def test_a_new_leader_leaves_workers_time_to_extend_their_leases(
    led: float, is_ended: bool
) -> None:
    """The database was away, for longer than a lease."""
    settings = SimpleNamespace(lease_s=10.0)
    runtime: Any = SimpleNamespace(settings=settings, transitions=Mock(), workers=Mock())
    pause_s = LEADER_PAUSE * HEARTBEAT_SHARE * settings.lease_s
    listening: Any = SimpleNamespace(is_leader=led > 0, led_s=led * pause_s)
    _urgent_tasks(runtime, listening)["expire leases"]()
    assert runtime.transitions.expire_leases.called == is_ended
