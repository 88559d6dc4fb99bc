"""How much each tenant may have stored, and have waiting."""

from __future__ import annotations

import threading
from collections import Counter

from service.gate import Caller
from service.jobs.database import Database
from service.jobs.retention import stored_bytes
from service.problems import QuotaExceededError

RETRY_AFTER_S = 60


class Shares:
    """Counts what is stored, and in this process what is on its way."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._arriving: Counter[str] = Counter()
        self._deciding = threading.Lock()

    def stored(self, tenant: str) -> int:
        """Bytes that are kept for the tenant or arrive."""
        return stored_bytes(self._database, tenant) + self._arriving[tenant]

    def reserve(self, caller: Caller, size: int) -> None:
        """Keep room for so many bytes until `release`; QuotaExceededError when there is not."""
        allowed = caller.limits.stored_bytes
        with self._deciding:
            if allowed is not None:
                used = self.stored(caller.tenant)
                if used + size > allowed or used >= allowed:
                    raise QuotaExceededError(
                        f"{used} bytes are stored for you or arrive, {allowed} may be: {size} more "
                        "have no room. Remove clouds or registrations.",
                        headers={"Retry-After": str(RETRY_AFTER_S)},
                        members={"limit": "stored_bytes", "used": used, "allowed": allowed},
                    )
            self._arriving[caller.tenant] += size

    def release(self, caller: Caller, size: int) -> None:
        """What was on its way is stored now, or has not come."""
        with self._deciding:
            self._arriving[caller.tenant] -= size
