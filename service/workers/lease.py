"""Lease of an attempt: extended at intervals, so that no other service takes the job."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from service.jobs.model import JobRow
from service.jobs.transitions import JobTransitions
from service.problems import NotReadyError

LEASE_S = 30.0
"""Lease of an attempt; another service may take the job when it is not extended for that long."""
HEARTBEAT_S = LEASE_S / 3
"""Interval at which the lease is extended."""


@contextmanager
def kept_lease(transitions: JobTransitions, job: JobRow) -> Iterator[None]:
    """Extend the lease of an attempt by a thread, while this one moves files."""
    has_ended = threading.Event()

    def extend() -> None:
        while not has_ended.wait(HEARTBEAT_S):
            with contextlib.suppress(NotReadyError):  # the lease outlasts a short outage
                transitions.extend_lease(job, lease_s=LEASE_S)

    thread = threading.Thread(target=extend, name="lease", daemon=True)
    thread.start()
    try:
        yield
    finally:
        has_ended.set()
        thread.join()
