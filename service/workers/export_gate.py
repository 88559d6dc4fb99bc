"""Turns of exports, waited for without a thread, and bounded for each tenant."""

from __future__ import annotations

import asyncio
from collections import Counter

from service.problems import OverloadedError, QuotaExceededError
from service.workers.exporter import MAX_RUNNING

MAX_WAITING = 16
"""Exports of all tenants that wait for their turn."""
MAX_WAITING_PER_TENANT = 4
"""Exports of one tenant that wait for their turn."""
RETRY_AFTER_S = 5


class ExportGate:
    """Lets MAX_RUNNING exports run, the tenant with the fewest first; for one event loop."""

    def __init__(self) -> None:
        self._running: Counter[str] = Counter()
        self._waiting: list[tuple[str, asyncio.Future[None]]] = []

    async def acquire(self, tenant: str) -> None:
        """Wait for a turn, which `release` ends.

        Raises
        ------
        QuotaExceededError
            MAX_WAITING_PER_TENANT exports of the tenant are waiting.
        OverloadedError
            MAX_WAITING exports are waiting.
        """
        if sum(self._running.values()) < MAX_RUNNING:
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
                f"{own} exports of this tenant are waiting already; fetch them first.",
                retry_after_s=RETRY_AFTER_S,
                members={"limit": "exports", "allowed": MAX_WAITING_PER_TENANT},
            )
        if len(self._waiting) >= MAX_WAITING:
            raise OverloadedError("Too many exports are waiting; retry later.")
