"""Time limits of one attempt, by clocks that nobody sets."""

from __future__ import annotations

import time
from typing import Self

from service.jobs.model import JobRow
from service.problems import DeadlineError, JobTimeoutError

MAX_STEP_S = 5.0
"""Time between two looks at the limits that counts at most, in seconds; more passes only while the
process is suspended, or waits for others."""
_BOOT_CLOCK: int = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)  # Linux has the former


class AttemptLimits:
    """The time limit of an attempt, and the deadline that the caller gave.

    Suspensions do not count towards the time limit. They do count towards the deadline; a clock
    that is set during the attempt changes neither.

    Parameters
    ----------
    timeout_s : float
        Seconds that the attempt may be supervised.
    deadline_s : float, optional
        Seconds from now until the deadline.
    """

    def __init__(self, timeout_s: float, deadline_s: float | None) -> None:
        self._timeout_s = timeout_s
        self._used_s = 0.0
        self._looked_at = time.monotonic()
        self._deadline = None if deadline_s is None else _boot_time() + deadline_s

    @classmethod
    def of(cls, job: JobRow, timeout_s: float) -> Self:
        """Return the limits of an attempt at the job that begins now."""
        deadline_s = None
        if job.deadline_at is not None and job.started_at is not None:  # by one clock
            deadline_s = job.deadline_at - job.started_at
        return cls(timeout_s, deadline_s)

    def remaining_s(self) -> float:
        """Return the seconds until the earlier limit.

        Raises
        ------
        JobTimeoutError, DeadlineError
            The limit has passed.
        """
        now = time.monotonic()
        self._used_s += min(now - self._looked_at, MAX_STEP_S)
        self._looked_at = now
        if self._used_s >= self._timeout_s:
            raise JobTimeoutError(f"The attempt was ended after the allowed {self._timeout_s:g} s.")
        remaining_s = self._timeout_s - self._used_s
        if self._deadline is None:
            return remaining_s
        until_deadline_s = self._deadline - _boot_time()
        if until_deadline_s <= 0:
            raise DeadlineError("The attempt was ended when the deadline passed.")
        return min(remaining_s, until_deadline_s)


def _boot_time() -> float:
    """Return the seconds since the start of the machine, suspensions included."""
    return time.clock_gettime(_BOOT_CLOCK)
