"""Kills, suspensions and full disks."""

from __future__ import annotations

import random
import time
from contextlib import suppress

import httpx
import psutil

from tests.e2e.soak.disk import Disk
from tests.e2e.soak.record import Record
from tests.factories.processes import forkserver, suspended
from tests.factories.server import Server

EVENT_INTERVAL_S = (1.0, 4.0)
"""Range of the pauses between two events."""
KINDS = ("suspension", "disk", "server", "worker", "forkserver")
SUSPENSION_S = (0.5, 2.0)


def disturb(server: Server, disk: Disk, record: Record, rng: random.Random, seconds: float) -> None:
    """Let one kind of event happen after the other until the soak is over.

    Each waits until the service has recovered from the one before: else a busy machine would do no
    work at all.
    The server is killed in the first third alone, so that the last process lives long enough to
    tell whether its memory grows.
    """
    calm_at = time.monotonic() + seconds / 3
    kinds: list[str] = []
    while _has_recovered(server, record) and not record.is_over.wait(
        rng.uniform(*EVENT_INTERVAL_S)
    ):
        is_calm = time.monotonic() > calm_at
        kinds = kinds or [kind for kind in KINDS if not (is_calm and kind == "server")]
        kind = kinds.pop(0)
        begin = time.time()
        _make_happen(kind, server, disk, rng)
        record.events[kind] += 1
        record.disturbed.append((begin, time.time()))


def _has_recovered(server: Server, record: Record) -> bool:
    """Wait until the service is ready; False when the soak is over before."""
    while not record.is_over.wait(0.2):
        with suppress(httpx.TransportError):
            if httpx.get(f"{server.url}/readyz", timeout=5, trust_env=False).status_code == 200:
                return True
    return False


def _make_happen(kind: str, server: Server, disk: Disk, rng: random.Random) -> None:
    if kind == "server":
        server.kill()
        server.start(ready=False)
    elif kind == "suspension":
        with suspended(server):
            time.sleep(rng.uniform(*SUSPENSION_S))
    elif kind == "disk":
        disk.fill()
    else:
        with suppress(psutil.Error, IndexError):
            parent = forkserver(server)
            rng.choice([parent] if kind == "forkserver" else parent.children()).kill()
