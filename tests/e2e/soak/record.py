"""What happens during a soak."""

from __future__ import annotations

import threading
from collections import Counter
from dataclasses import dataclass, field

import httpx

LATER = (409, 410, 429, 503, 507)
"""Answers after which the same request may succeed later."""


@dataclass
class Record:
    """Answers, events and faults; written by all threads."""

    accepted: dict[str, str] = field(default_factory=dict)
    """Tenant of each accepted job that nobody has deleted."""
    answers: Counter[str] = field(default_factory=Counter)
    done: Counter[str] = field(default_factory=Counter)
    """How often each kind of request was begun."""
    rests: int = 0
    """How often a client waited as a refusal asked it to."""
    events: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)
    disturbed: list[tuple[float, float]] = field(default_factory=list)
    """When each kill, suspension or full disk began and ended, by `time.time`."""
    use: list[tuple[int, float, int]] = field(default_factory=list)
    """Id of the service's process, its memory in MiB, its descriptors; over time."""
    is_over: threading.Event = field(default_factory=threading.Event)

    def jobs_of(self, tenant: str) -> list[str]:
        """Ids of the accepted jobs of a tenant."""
        return [job for job, owner in list(self.accepted.items()) if owner == tenant]

    def jobs_of_others(self, tenant: str) -> list[str]:
        """Ids of the accepted jobs of all other tenants."""
        return [job for job, owner in list(self.accepted.items()) if owner != tenant]

    def note(self, response: httpx.Response) -> None:
        """Count an answer; an error of the service is a fault."""
        self.answers[str(response.status_code)] += 1
        if response.status_code >= 500 and response.status_code not in LATER:
            text = response.text if response.is_closed else "..."
            self.faults.append(f"{response.request.method} {response.request.url}: {text}")

    def was_disturbed(self, at: float, took: float) -> bool:
        """Whether a call fell into a kill, suspension or full disk."""
        return any(begin <= at + took and at <= end for begin, end in self.disturbed)
