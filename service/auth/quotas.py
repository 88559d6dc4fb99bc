"""Storage quota of each tenant."""

from __future__ import annotations

import threading
import time
from collections import Counter
from dataclasses import dataclass

from service.auth.authenticator import Caller
from service.database.engine import Database
from service.jobs.usage import count_stored_bytes
from service.problems import QuotaExceededError

CACHE_TTL_S = 1.0
"""Minimum time in seconds that a count of stored bytes is used."""
MAX_COUNTING_FRACTION = 0.05
"""Maximum fraction of the time spent counting: a slow count is used longer (docs/tuning.md)."""


@dataclass(slots=True)
class _Count:
    bytes: int
    """Bytes counted in the database, and released since."""
    until: float


class StorageQuota:
    """Bytes that each tenant has stored or is sending to this process.

    Stored bytes are counted in the database at most once in CACHE_TTL_S; bytes being received are
    reserved here until they are stored or dropped.
    """

    def __init__(self, database: Database) -> None:
        self._database = database
        self._counts: dict[str, _Count] = {}
        self._reserved: Counter[str] = Counter()
        self._lock = threading.Lock()

    def used(self, tenant: str) -> int:
        """Return the bytes that are stored or reserved."""
        started = time.monotonic()
        with self._lock:
            count = self._counts.get(tenant)
            if count is not None and started < count.until:
                return count.bytes + self._reserved[tenant]
        counted = count_stored_bytes(self._database, tenant)
        now = time.monotonic()
        until = now + max(CACHE_TTL_S, (now - started) / MAX_COUNTING_FRACTION)
        with self._lock:
            self._counts[tenant] = _Count(counted, until)
            return counted + self._reserved[tenant]

    def reserve(self, caller: Caller, size: int) -> None:
        """Reserve bytes that are about to arrive, until `release`.

        Raises
        ------
        QuotaExceededError
            They would exceed the caller's limit, or it is reached already.
        """
        limit = caller.limits.stored_bytes
        if limit is not None:
            self.used(caller.tenant)
        with self._lock:
            if limit is not None:
                used = self._counts[caller.tenant].bytes + self._reserved[caller.tenant]
                if used + size > limit or used >= limit:
                    raise _exceeded(used, size, limit)
            self._reserved[caller.tenant] += size

    def release(self, caller: Caller, size: int) -> None:
        """End a reservation; its bytes count as stored until the next count of the database."""
        with self._lock:
            self._reserved[caller.tenant] -= size
            if caller.tenant in self._counts:
                self._counts[caller.tenant].bytes += size


def _exceeded(used: int, size: int, limit: int) -> QuotaExceededError:
    return QuotaExceededError(
        f"Storage quota exceeded: {used} of {limit} bytes are in use or being uploaded, and this "
        f"request needs {size} more. Delete clouds or registrations.",
        members={"limit": "stored_bytes", "used": used, "allowed": limit},
    )
