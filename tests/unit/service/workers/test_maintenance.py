"""Maintenance calls its tasks in their order, and one that fails keeps no other from its turn."""

from __future__ import annotations

import threading

import pytest

from service.workers.maintenance import Maintenance


def test_a_task_that_fails_is_logged_and_the_others_are_called(
    caplog: pytest.LogCaptureFixture,
) -> None:
    called: list[str] = []

    def fail() -> None:
        called.append("second")
        raise ZeroDivisionError

    tasks = [lambda: called.append("first"), fail, lambda: called.append("third")]
    Maintenance(tasks, 1.0).run_once()
    assert called == ["first", "second", "third"]
    assert "ZeroDivisionError" in caplog.text


def test_a_task_that_goes_on_failing_is_logged_once(caplog: pytest.LogCaptureFixture) -> None:
    fails = True

    def task() -> None:
        if fails:
            raise ZeroDivisionError

    maintenance = Maintenance([task], 1.0)
    maintenance.run_once()
    maintenance.run_once()
    assert caplog.text.count("a maintenance task failed") == 1
    fails = False
    maintenance.run_once()
    fails = True
    maintenance.run_once()
    assert caplog.text.count("a maintenance task failed") == 2


def test_tasks_are_called_again_and_again_until_it_stops() -> None:
    seen, count = threading.Event(), 0

    def task() -> None:
        nonlocal count
        count += 1
        if count == 3:
            seen.set()

    maintenance = Maintenance([task], 0.001)
    maintenance.start()
    assert seen.wait(30)
    maintenance.stop()
    last = count
    threading.Event().wait(0.05)
    assert count == last
