"""Rate limit of each key: the generic cell rate algorithm (ITU-T I.371)."""

from __future__ import annotations

import time

from service.auth.authenticator import Caller
from service.problems import RateLimitedError


class RateLimiter:
    """Limit the requests per second of each key; to be used within one event loop.

    A key that was idle for a second can send `requests_per_s` requests at once, at least one. Then,
    or if it sends evenly, `requests_per_s` requests per second.
    """

    def __init__(self) -> None:
        self._due: dict[str, float] = {}
        """Time at which each key's requests so far are paid off: the theoretical arrival time."""

    def check(self, caller: Caller) -> None:
        """Count a request.

        Raises
        ------
        RateLimitedError
            It comes too early; it is not counted then.
        """
        rate = caller.limits.requests_per_s
        if rate is None or caller.key_id is None:
            return
        now = time.monotonic()
        due = max(now, self._due.get(caller.key_id, 0.0))
        burst_s = max(0.0, (rate - 1) / rate)
        early_s = due - now - burst_s
        if early_s > 0:
            raise RateLimitedError(
                f"Rate limit exceeded: this key allows {rate:g} requests per second. Retry later.",
                retry_after_s=early_s,
                members={"limit": "requests_per_s", "allowed": rate},
            )
        self._due[caller.key_id] = due + 1 / rate
