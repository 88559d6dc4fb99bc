"""Wait for what another process will do."""

from __future__ import annotations

import time
from collections.abc import Callable


def until(happened: Callable[[], bool], *, within_s: float = 30) -> None:
    """Return as soon as `happened()`; fail when it has not within `within_s` seconds."""
    deadline = time.monotonic() + within_s
    while not happened():
        assert time.monotonic() < deadline, f"waited {within_s} s in vain"
        time.sleep(0.02)
