"""The limits of an attempt, whatever happens to the clock and to the machine."""

from __future__ import annotations

import time
from dataclasses import dataclass

import pytest

from service.problems import DeadlineError, JobTimeoutError
from service.workers import attempt_limits as module
from service.workers.attempt_limits import MAX_STEP_S, AttemptLimits
from tests.factories.jobs import new_job


@dataclass
class Clocks:
    """The clocks of a machine."""

    running: float = 1000.0
    since_boot: float = 2000.0
    wall: float = 1e9

    def run(self, seconds: float) -> None:
        """Let time pass while the service looks at its limits."""
        self.running += seconds
        self.since_boot += seconds
        self.wall += seconds


@pytest.fixture
def clocks(monkeypatch: pytest.MonkeyPatch) -> Clocks:
    clocks = Clocks()
    monkeypatch.setattr(time, "monotonic", lambda: clocks.running)
    monkeypatch.setattr(time, "time", lambda: clocks.wall)
    monkeypatch.setattr(module, "_boot_time", lambda: clocks.since_boot)
    return clocks


def look_for(limits: AttemptLimits, clocks: Clocks, seconds: float) -> None:
    """Look once a second."""
    for _ in range(int(seconds)):
        clocks.run(1.0)
        limits.remaining_s()


def test_the_time_limit_passes(clocks: Clocks) -> None:
    limits = AttemptLimits(10.0, None)
    look_for(limits, clocks, 9)
    assert limits.remaining_s() == 1.0
    clocks.run(1.0)
    with pytest.raises(JobTimeoutError, match="allowed 10 s"):
        limits.remaining_s()


def test_a_suspension_costs_no_more_than_a_step(clocks: Clocks) -> None:
    limits = AttemptLimits(10.0, None)
    clocks.run(3600.0)
    assert limits.remaining_s() == 10.0 - MAX_STEP_S


@pytest.mark.parametrize("jump", [700.0, -700.0])
def test_a_jump_of_the_clock_changes_no_limit(clocks: Clocks, jump: float) -> None:
    job = new_job(started_at=clocks.wall, deadline_at=clocks.wall + 30)
    limits = AttemptLimits.of(job, 600.0)
    clocks.wall += jump
    look_for(limits, clocks, 29)
    assert limits.remaining_s() == 1.0
    clocks.run(1.0)
    with pytest.raises(DeadlineError):
        limits.remaining_s()


def test_a_suspension_counts_towards_the_deadline(clocks: Clocks) -> None:
    limits = AttemptLimits(600.0, 30.0)
    clocks.since_boot += 60.0
    with pytest.raises(DeadlineError):
        limits.remaining_s()
