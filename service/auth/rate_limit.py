"""How often each key may be used: the generic cell rate algorithm (ITU-T I.371)."""

from __future__ import annotations

import time

from service.auth.authenticator import Caller
from service.problems import RateLimitedError


class RateLimiter:
    """Belongs to one event loop.

    A key that is used evenly may be used `requests_per_s` times a second; one that has rested, as
    many times at once, and once at least.
    """

    def __init__(self) -> None:
        self._due: dict[str, float] = {}

    def count(self, caller: Caller) -> None:
        """Count a request; RateLimitedError when it comes too early."""
        rate = caller.limits.requests_per_s
        if rate is None or caller.key_id is None:
            return
        now = time.monotonic()
        due = max(now, self._due.get(caller.key_id, 0.0))
        early = due - now - max(0.0, (rate - 1) / rate)
        if early > 0:
            raise RateLimitedError(
                f"Rate limit exceeded: this key allows {rate:g} requests per second. Retry later.",
                retry_after_s=early,
                members={"limit": "requests_per_s", "allowed": rate},
            )
        self._due[caller.key_id] = due + 1 / rate
