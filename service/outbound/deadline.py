"""Time limits of a transfer."""

from __future__ import annotations

import time
from dataclasses import dataclass

from service.outbound.errors import FetchTooSlowError


@dataclass(frozen=True, slots=True)
class TransferLimits:
    """Bounds on the duration and the speed of one transfer.

    >>> TransferLimits(total_s=300, read_timeout_s=20, min_bytes_per_s=1000)
    TransferLimits(total_s=300, read_timeout_s=20, min_bytes_per_s=1000)
    """

    total_s: float
    read_timeout_s: float
    """Time limit of each wait in seconds, and the interval over which the speed is measured."""
    min_bytes_per_s: float = 0.0


class TransferDeadline:
    """Enforce the limits of one transfer; its total time runs from the construction."""

    def __init__(self, limits: TransferLimits) -> None:
        self._limits = limits
        self._end = time.monotonic() + limits.total_s
        self._interval_start: float | None = None
        self._interval_bytes = 0

    def remaining(self) -> float:
        """Return the seconds that the next step may take.

        Raises
        ------
        FetchTooSlowError
            The total time is over.
        """
        left = self._end - time.monotonic()
        if left <= 0:
            raise FetchTooSlowError(
                f"The transfer took longer than the allowed {self._limits.total_s:g} s."
            )
        return min(left, self._limits.read_timeout_s)

    def start(self) -> None:
        """Measure the speed anew, from the first bytes of a new connection."""
        self._interval_start, self._interval_bytes = None, 0

    def received(self, count: int) -> None:
        """Count bytes that arrived.

        Raises
        ------
        FetchTooSlowError
            The speed over the last interval was below the minimum.
        """
        now = time.monotonic()
        if self._interval_start is None:
            self._interval_start = now
        self._interval_bytes += count
        elapsed = now - self._interval_start
        if elapsed < self._limits.read_timeout_s:
            return
        if self._interval_bytes < elapsed * self._limits.min_bytes_per_s:
            raise FetchTooSlowError(
                "The URL's file came at less than the required "
                f"{self._limits.min_bytes_per_s:g} bytes per second."
            )
        self._interval_start, self._interval_bytes = now, 0
