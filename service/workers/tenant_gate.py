"""Turns of costly calls, waited for without a thread, and bounded for each tenant."""

from __future__ import annotations

import asyncio
from collections import Counter

from service.problems import OverloadedError, QuotaExceededError

MAX_WAITING = 16
"""Calls of all tenants that wait for their turn."""
MAX_WAITING_PER_TENANT = 4
"""Calls of one tenant that wait for their turn."""
RETRY_AFTER_S = 5


class TenantGate:
    """Lets a few calls of one kind run, the tenant with the fewest first; for one event loop.

    Parameters
    ----------
    max_running : int
        Calls that run at once.
    name : str
        What they are, in the plural: for messages, and as the name of the limit.
    """

    def __init__(self, max_running: int, name: str) -> None:
        self._max_running = max_running
        self._name = name
        self._running: Counter[str] = Counter()
        self._waiting: list[tuple[str, asyncio.Future[None]]] = []

    async def acquire(self, tenant: str) -> None:
        """Wait for a turn, which `release` ends.

        Raises
        ------
        QuotaExceededError
            MAX_WAITING_PER_TENANT calls of the tenant are waiting.
        OverloadedError
            MAX_WAITING calls are waiting.
        """
        if sum(self._running.values()) < self._max_running:
            self._running[tenant] += 1
            return
        self._check_room(tenant)
        turn: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._waiting.append((tenant, turn))
        try:
            await turn
        except asyncio.CancelledError:
            if turn.cancelled():
                self._waiting.remove((tenant, turn))
            else:
                self.release(tenant)
            raise

    def release(self, tenant: str) -> None:
        """End a turn and begin the next."""
        self._running[tenant] -= 1
        if not self._running[tenant]:
            del self._running[tenant]
        waiting = [entry for entry in self._waiting if not entry[1].done()]
        if waiting:
            chosen = min(waiting, key=lambda entry: self._running[entry[0]])
            self._waiting.remove(chosen)
            self._running[chosen[0]] += 1
            chosen[1].set_result(None)

    def _check_room(self, tenant: str) -> None:
        own = sum(other == tenant for other, _ in self._waiting)
        if own >= MAX_WAITING_PER_TENANT:
            raise QuotaExceededError(
                f"{own} {self._name} of this tenant are waiting already; let them end first.",
                retry_after_s=RETRY_AFTER_S,
                members={"limit": self._name, "allowed": MAX_WAITING_PER_TENANT},
            )
        if len(self._waiting) >= MAX_WAITING:
            raise OverloadedError(f"Too many {self._name} are waiting; retry later.")
