"""Wait for what another process will do."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

Seen = TypeVar("Seen")


def until(look: Callable[[], Seen], *, within_s: float = 90, every_s: float = 0.02) -> Seen:
    """What `look()` gives once that is true; fail when it is not within `within_s` seconds.

    The bound only ends a test that would hang: it is far above what a busy machine takes.
    """
    deadline = time.monotonic() + within_s
    while not (seen := look()):
        assert time.monotonic() < deadline, f"waited {within_s} s in vain; last seen: {seen!r}"
        time.sleep(every_s)
    return seen
