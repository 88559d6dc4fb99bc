"""When a request is sent again, and for how long."""

from __future__ import annotations

import random
import time
from dataclasses import dataclass, field

import httpx

GATEWAY_STATUSES = frozenset({502, 503, 504})
"""Statuses of a proxy whose service does not answer; the service's own say Retry-After."""


@dataclass(frozen=True, slots=True)
class Patience:
    """How long a service that does not answer is tried again."""

    max_s: float = 120.0
    """Seconds without an answer after which the client gives up."""
    first_s: float = 0.2
    """Seconds before the second try; each further pause is twice as long."""
    most_s: float = 5.0
    """Seconds of the longest pause, unless the service asks for a longer one."""


@dataclass(slots=True)
class Tries:
    """The tries of one request."""

    patience: Patience
    _count: int = 0
    _began: float = field(default_factory=time.monotonic)

    def next_pause(self, asked_s: float = 0.0) -> float | None:
        """Return the seconds to wait before the next try; None where the patience is at its end.

        Parameters
        ----------
        asked_s
            Seconds that the service asks to wait.
        """
        longest = min(self.patience.most_s, self.patience.first_s * 2 ** min(self._count, 30))
        self._count += 1
        pause = max(asked_s, longest * random.uniform(0.5, 1.0))  # noqa: S311
        left = self.patience.max_s - (time.monotonic() - self._began)
        return None if pause > left else pause

    def reset(self) -> None:
        """Begin anew: the service has answered."""
        self._count, self._began = 0, time.monotonic()


def asked_pause(response: httpx.Response) -> float | None:
    """Return the seconds after which a refused request may be sent again; None: never."""
    if not response.is_error:
        return None
    stated = response.headers.get("Retry-After", "")
    if stated.isdecimal():
        return float(stated)
    is_of_service = response.headers.get("Content-Type", "").startswith("application/problem+json")
    is_passing = response.status_code in GATEWAY_STATUSES and not is_of_service
    return 0.0 if is_passing else None
