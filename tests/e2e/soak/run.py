"""One soak: clients, disturbances, probes, and the check of all ends."""

from __future__ import annotations

import os
import random
import threading
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import psutil

from service.problems import INTERNAL
from tests.e2e.answer_times import Calls, measured, percentiles_ms
from tests.e2e.attacks.catalog import ATTACKS
from tests.e2e.attacks.target import Target
from tests.e2e.attacks.traps import Traps, open_traps
from tests.e2e.soak.disk import Disk, small_disk
from tests.e2e.soak.disturb import disturb
from tests.e2e.soak.record import Record
from tests.e2e.soak.requests import Honest
from tests.factories.logs import logged_errors, logged_exceptions
from tests.factories.server import Server, finished, running_server
from tests.factories.tenants import caller, new_key

TENANTS = ("ada", "bo", "cy", "di")
HOSTILE_EVERY = 10
"""Each tenth client is hostile."""
NICENESS = 5
"""Of the clients: they stand for other machines."""
SETTINGS = {
    "require_keys": True,
    "maintenance_interval_s": 1,
    "key_queue_limit": 8,
    "head_timeout_s": 2,
    "body_stall_timeout_s": 4,
    "private_networks": "127.0.0.0/8",
    "url_read_timeout_s": 2,
    "webhook_hosts": "127.0.0.1",
    "webhook_secret": "soak",
}
MIN_TREND_S = 300.0
"""Shortest run from which memory and descriptors are judged."""
MAX_GROWTH, MAX_GROWTH_MIB, MAX_GROWTH_DESCRIPTORS = 1.2, 20.0, 40.0
"""Growth from the first to the second half of the longest process that is no fault."""


@dataclass
class Soak:
    """One run."""

    server: Server
    disk: Disk
    traps: Traps
    seconds: float
    clients: int
    seed: int
    keys: dict[str, str] = field(default_factory=dict)
    record: Record = field(default_factory=Record)

    def run(self) -> dict[str, Any]:
        self.keys = {tenant: new_key(self.server, tenant, queue_limit=None) for tenant in TENANTS}
        rng, over = random.Random(self.seed), self.record.is_over
        calls: list[Callable[[], None]] = [
            lambda: disturb(self.server, self.disk, self.record, rng, self.seconds),
            self._watch_use,
        ]
        threads = [threading.Thread(target=self._behave, args=(i,)) for i in range(self.clients)]
        threads += [threading.Thread(target=call) for call in calls]
        with measured(self.server.port) as (livez, bare):
            for thread in threads:
                thread.start()
            over.wait(self.seconds)
            over.set()
            for thread in threads:
                thread.join()
        ends = self._check_ends()
        return self._figures(ends, livez, bare)

    def _behave(self, number: int) -> None:
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICENESS)
        rng, tenant = random.Random(self.seed * 1000 + number), TENANTS[number % len(TENANTS)]
        key, port, over = self.keys[tenant], self.server.port, self.record.is_over
        with caller(self.server, key) as client:
            client.timeout = httpx.Timeout(30)
            honest = Honest(tenant, client, self.traps, self.record, rng)
            is_hostile = number % HOSTILE_EVERY == 0
            if not is_hostile:
                client.event_hooks = {"response": [honest.rest]}
            while not over.is_set():
                try:
                    if is_hostile:
                        job = next(iter(self.record.jobs_of(tenant)), "")
                        attack = rng.choice(list(ATTACKS.values()))
                        attack(Target(port, key, self.traps, job, over), rng)
                    else:
                        honest.act()
                except (httpx.TransportError, OSError):  # the server was killed, or is suspended
                    self.record.answers["no answer"] += 1
                    over.wait(0.1)

    def _watch_use(self) -> None:
        while not self.record.is_over.wait(0.5):
            with suppress(psutil.Error):
                process = psutil.Process(self.server.pid)
                used = process.memory_info().rss / 2**20
                self.record.use.append((process.pid, used, process.num_fds()))

    def _check_ends(self) -> Counter[str]:
        """Wait for every accepted job; how many ended in which way."""
        ends: Counter[str] = Counter()
        for job, tenant in self.record.accepted.items():
            with caller(self.server, self.keys[tenant]) as client:
                if client.get(f"/v1/registrations/{job}").status_code != 200:
                    self.record.faults.append("an accepted job is lost")
                    continue
                end = finished(client, job)
                problem = _find_fault(end, tenant, self.server.log)
                if problem:
                    self.record.faults.append(problem)
                error = end["error"] or {}
                ends[error.get("type", end["status"]).removeprefix("urn:mpe:problem:")] += 1
        return ends

    def _figures(self, ends: Counter[str], livez: Calls, bare: Calls) -> dict[str, Any]:
        record = self.record
        calm = [
            [call for call in calls if not record.was_disturbed(call.began_at, call.took_s)]
            for calls in (livez, bare)
        ]
        memory, descriptors = _halves(record.use)
        if self.seconds >= MIN_TREND_S:
            record.faults += _find_growth(memory, descriptors)
        return {
            "jobs accepted and kept": len(record.accepted),
            "faults": record.faults[:20],
            "how they ended": dict(ends),
            "requests": dict(sorted(record.done.items())),
            "answers": dict(sorted(record.answers.items())),
            "waits that a refusal asked for": record.rests,
            "killed, suspended, disk filled": dict(record.events),
            "errors logged": dict(logged_errors(self.server.log)),
            "/livez p50, p99 (ms), calls": (*percentiles_ms(calm[0]), len(calm[0])),
            "bare server p50, p99 (ms)": percentiles_ms(calm[1]),
            "memory of the longest process, halves (MiB)": memory,
            "descriptors of the longest process, halves": descriptors,
        }


def _find_fault(end: dict[str, Any], tenant: str, log: str) -> str | None:
    """What is wrong with the end of a job that registers a cloud to itself; None: nothing."""
    if end["labels"].get("tenant") != tenant:
        return "a job has the labels of another tenant"
    if end["status"] == "failed" and end["error"]["status"] < 500:
        return f"a job failed: {end['error']}"
    if end["error"] and end["error"]["status"] == INTERNAL.status:
        return f"a job ended with {end['error']}: {logged_exceptions(log, end['id'])}"
    if end["status"] == "succeeded":
        off = np.abs(np.array(end["result"]["transform"]) - np.eye(4)).max()
        return f"a result is off by {off}" if off > 0.05 else None
    return None


def _halves(use: list[tuple[int, float, int]]) -> tuple[tuple[float, float], tuple[float, float]]:
    """Medians of both halves of the longest process: memory, descriptors; NaN without values."""
    by_process = Counter(pid for pid, _, _ in use)
    longest = max(by_process, key=by_process.__getitem__, default=None)
    of_longest = np.array([row[1:] for row in use if row[0] == longest] or [[np.nan] * 2] * 2)
    half = len(of_longest) // 2
    first, second = np.median(of_longest[:half], 0), np.median(of_longest[half:], 0)
    return (float(first[0]), float(second[0])), (float(first[1]), float(second[1]))


def _find_growth(memory: tuple[float, float], descriptors: tuple[float, float]) -> list[str]:
    faults = []
    if memory[1] > MAX_GROWTH * memory[0] + MAX_GROWTH_MIB:
        faults.append(f"the memory grows: {memory} MiB")
    if descriptors[1] > MAX_GROWTH * descriptors[0] + MAX_GROWTH_DESCRIPTORS:
        faults.append(f"descriptors grow: {descriptors}")
    return faults


def run(directory: Path, *, seconds: float, clients: int, seed: int) -> dict[str, Any]:
    """Soak a server in the directory and return the figures."""
    with small_disk(directory / "data") as disk, open_traps() as traps:
        settings = SETTINGS | {"min_free_disk_bytes": disk.min_free_bytes}
        with running_server(directory, **settings) as server:
            return Soak(server, disk, traps, seconds, clients, seed).run()
