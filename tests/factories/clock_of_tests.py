"""A clock that tests set forward, and the times of the store of blobs that they pass."""

from __future__ import annotations

import time

GRACE_S = 600.0
CACHE_BYTES = 1 << 30


class Clock:
    """The time of a test; `wait` passes it at once."""

    def __init__(self) -> None:
        self.waited_s = 0.0

    def wait(self, seconds: float) -> None:
        self.waited_s += seconds

    @property
    def now(self) -> float:
        return time.time() + self.waited_s
