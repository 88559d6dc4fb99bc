"""How long a call may last, and how slow it may be."""

from __future__ import annotations

import time
from dataclasses import dataclass

from service.outbound.errors import FetchTooSlowError


@dataclass(frozen=True, slots=True)
class TransferLimits:
    """Bounds on one call."""

    total_s: float
    stall_s: float
    """Longest wait for the next bytes, and the time over which the speed is measured."""
    min_bytes_s: float = 0.0


class TransferDeadline:
    """Watches one call, from its making."""

    def __init__(self, bounds: TransferLimits) -> None:
        self._bounds = bounds
        self._end = time.monotonic() + bounds.total_s
        self._since: float | None = None
        self._count = 0

    def wait(self) -> float:
        """Seconds that the next step may take; FetchTooSlowError when no time is left."""
        left = self._end - time.monotonic()
        if left <= 0:
            raise FetchTooSlowError(f"It took longer than the allowed {self._bounds.total_s:g} s.")
        return min(left, self._bounds.stall_s)

    def begin(self) -> None:
        """A connection was made: the speed is measured from its first bytes."""
        self._since, self._count = None, 0

    def came(self, count: int) -> None:
        """So many bytes came; FetchTooSlowError when too few did."""
        now = time.monotonic()
        self._since = self._since or now
        self._count += count
        elapsed = now - self._since
        if elapsed < self._bounds.stall_s:
            return
        if self._count < elapsed * self._bounds.min_bytes_s:
            raise FetchTooSlowError(
                f"It came at less than the required {self._bounds.min_bytes_s:g} bytes a second."
            )
        self._since, self._count = now, 0
