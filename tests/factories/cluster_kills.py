"""Kills parts of a cluster at random and starts them again."""

from __future__ import annotations

import random
import threading
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import psutil

from tests.factories.cluster import Cluster
from tests.factories.processes import forkserver
from tests.factories.server import Server
from tests.factories.waiting import until

KINDS = ("worker", "worker", "api", "database", "store", "process", "forkserver")
"""What is killed; each once before any is killed again."""
PAUSE_S = (0.05, 0.6)
"""Between two kills."""
DOWN_S = (0.2, 2.0)
"""How long database, store or service is away."""
BUSY_S = 3.0
"""How long a worker without a job is waited for."""


@dataclass(frozen=True)
class Loss:
    """A job that a worker was at when it was killed; seconds since the epoch."""

    job_id: str
    at: float


class Killer:
    """Kills `number` times, in an order that the seed fixes."""

    def __init__(self, cluster: Cluster, number: int, seed: int) -> None:
        self._cluster = cluster
        self._number = number
        self._rng = random.Random(seed)
        self._down: set[int] = set()
        self._restarts: list[threading.Thread] = []
        self.killed: Counter[str] = Counter()
        self.losses: list[Loss] = []

    @property
    def total(self) -> int:
        return self.killed.total()

    def run(self) -> None:
        """Make all kills, and wait until everything is up again.

        Call it in the main thread: database and store end with the thread that started them.
        """
        kill: dict[str, Callable[[], bool]] = {
            "worker": self._kill_worker,
            "api": lambda: self._kill_service(self._any(self._cluster.apis)),
            "database": self._kill_database,
            "store": self._kill_store,
            "process": lambda: self._kill_below(of_forkserver=False),
            "forkserver": lambda: self._kill_below(of_forkserver=True),
        }
        kinds: list[str] = []
        while self.total < self._number:
            time.sleep(self._rng.uniform(*PAUSE_S))
            kinds = kinds or self._rng.sample(KINDS, len(KINDS))
            if kill[kinds[-1]]():
                self.killed[kinds.pop()] += 1
        for thread in self._restarts:
            thread.join()

    def _any(self, services: list[Server]) -> Server | None:
        up = [service for service in services if service.port not in self._down]
        return self._rng.choice(up) if up else None

    def _kill_worker(self) -> bool:
        """One that is at a job, where that is soon the case."""
        worker = self._any(self._cluster.workers)
        if worker is None:
            return False
        deadline = time.monotonic() + BUSY_S
        while not _jobs_at(worker) and time.monotonic() < deadline:
            time.sleep(0.005)
        lost = _jobs_at(worker)
        killed_at = time.time()
        self._kill_service(worker)
        self.losses += [Loss(job_id, killed_at) for job_id in lost]
        return True

    def _kill_service(self, service: Server | None) -> bool:
        if service is None:
            return False
        self._down.add(service.port)
        service.kill()
        thread = threading.Thread(target=self._restart, args=(service, self._away_s()))
        self._restarts.append(thread)
        thread.start()
        return True

    def _restart(self, service: Server, away_s: float) -> None:
        time.sleep(away_s)
        until(lambda: _has_started(service), within_s=600)
        self._down.discard(service.port)

    def _kill_database(self) -> bool:
        self._cluster.postgres.kill()
        time.sleep(self._away_s())
        self._cluster.postgres.start()
        return True

    def _kill_store(self) -> bool:
        self._cluster.store.kill()
        time.sleep(self._away_s())
        self._cluster.store.start()
        return True

    def _kill_below(self, *, of_forkserver: bool) -> bool:
        worker = self._any(self._cluster.workers)
        if worker is None:
            return False
        try:
            parent = forkserver(worker)
            self._rng.choice([parent] if of_forkserver else parent.children()).kill()
        except (psutil.NoSuchProcess, IndexError):
            return False
        return True

    def _away_s(self) -> float:
        return self._rng.uniform(*DOWN_S)


def _has_started(service: Server) -> bool:
    """Start it; False where it gave up, as the database or the store was away."""
    try:
        service.start()
    except AssertionError:
        if service.is_running:
            raise
        return False
    return True


def _jobs_at(worker: Server) -> list[str]:
    """The jobs that it registers now; scratch folders are named by job, queue and attempt."""
    folders = (worker.data_dir / "scratch").glob("*-register-*")
    return [folder.name.rpartition("-register-")[0] for folder in folders]
