"""Lease of an attempt: extended at intervals, so that no other service takes the job."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from service.jobs.model import JobRow
from service.jobs.transitions import JobTransitions
from service.problems import NotReadyError

HEARTBEAT_SHARE = 1 / 5
"""Interval at which a lease is extended, as a share of it: four extensions may fail."""


@contextmanager
def kept_lease(transitions: JobTransitions, job: JobRow, *, lease_s: float) -> Iterator[None]:
    """Extend the lease of an attempt by a thread, while this one moves files."""
    has_ended = threading.Event()

    def extend() -> None:
        while not has_ended.wait(HEARTBEAT_SHARE * lease_s):
            with contextlib.suppress(NotReadyError):  # the lease outlasts a short outage
                transitions.extend_lease(job, lease_s=lease_s)

    thread = threading.Thread(target=extend, name="lease", daemon=True)
    thread.start()
    try:
        yield
    finally:
        has_ended.set()
        thread.join()
