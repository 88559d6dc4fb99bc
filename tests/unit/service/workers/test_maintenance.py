"""Maintenance calls its tasks in their order, and one that fails keeps no other from its turn."""

from __future__ import annotations

import errno
import threading

import pytest

from service.problems import NotReadyError
from service.workers import maintenance as module
from service.workers.maintenance import Maintenance


def test_a_task_that_fails_is_logged_and_the_others_are_called(
    caplog: pytest.LogCaptureFixture,
) -> None:
    called: list[str] = []

    def fail() -> None:
        called.append("second")
        raise ZeroDivisionError

    tasks = {
        "one": lambda: called.append("first"),
        "two": fail,
        "three": lambda: called.append("third"),
    }
    Maintenance(tasks, 1.0).run_once()
    assert called == ["first", "second", "third"]
    (record,) = caplog.records
    assert record.levelname == "ERROR"
    assert "'two' failed" in record.getMessage()
    assert "ZeroDivisionError()" in record.getMessage()


@pytest.mark.parametrize(
    "error", [NotReadyError("the store is away"), OSError(errno.ENOSPC, "no space")]
)
def test_a_task_that_waits_for_store_or_disk_is_no_error(
    caplog: pytest.LogCaptureFixture, error: Exception
) -> None:
    def fail() -> None:
        raise error

    Maintenance({"wait": fail}, 1.0).run_once()
    (record,) = caplog.records
    assert record.levelname == "WARNING"
    assert repr(error) in record.getMessage()


def test_a_task_that_goes_on_failing_is_logged_once(caplog: pytest.LogCaptureFixture) -> None:
    fails = True

    def task() -> None:
        if fails:
            raise ZeroDivisionError

    maintenance = Maintenance({"task": task}, 1.0)
    maintenance.run_once()
    maintenance.run_once()
    assert caplog.text.count("the maintenance task 'task' failed") == 1
    fails = False
    maintenance.run_once()
    fails = True
    maintenance.run_once()
    assert caplog.text.count("the maintenance task 'task' failed") == 2


def test_tasks_are_called_again_and_again_until_it_stops() -> None:
    seen, count = threading.Event(), 0

    def task() -> None:
        nonlocal count
        count += 1
        if count == 3:
            seen.set()

    maintenance = Maintenance({"task": task}, 0.001)
    maintenance.start()
    assert seen.wait(30)
    maintenance.stop()
    last = count
    threading.Event().wait(0.05)
    assert count == last


def test_a_task_that_hangs_does_not_keep_the_service_from_its_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module, "STOP_S", 0.05)
    has_begun, goes_on = threading.Event(), threading.Event()

    def hang() -> None:
        has_begun.set()
        assert goes_on.wait(20)

    maintenance = Maintenance({"hang": hang}, 0.001)
    maintenance.start()
    assert has_begun.wait(20)
    maintenance.stop()
    assert not goes_on.is_set()
    goes_on.set()
