"""The embedded queue: threads that claim waiting jobs and supervise one child process each."""

from __future__ import annotations

import contextlib
import logging
import shutil
import threading
from collections.abc import Callable

from service.jobs.child import Child, ChildLostError, prepare_forkserver
from service.jobs.job import JobRow
from service.jobs.store import JobStore
from service.jobs.task import ready
from service.jobs.worker import LEASE_S, Worker
from service.settings import Settings

POLL_S = 1.0
WARM_UP_S = 120.0

log = logging.getLogger(__name__)


class Queue:
    """Runs as many jobs at once as there are workers; the store says which is next."""

    def __init__(
        self, store: JobStore, settings: Settings, announce: Callable[[str], None]
    ) -> None:
        self._store = store
        self._settings = settings
        self._worker = Worker(store, settings, announce, self._remember)
        self._running: dict[str, tuple[JobRow, Child]] = {}
        self._wake = threading.Semaphore(0)
        self._stopping = threading.Event()
        self._warm = threading.Event()
        self._threads = [
            threading.Thread(target=self._serve, name=f"worker-{i}", daemon=True)
            for i in range(settings.workers)
        ]

    @property
    def is_ready(self) -> bool:
        """Whether jobs start at once."""
        return self._warm.is_set() and not self._stopping.is_set()

    def start(self) -> None:
        """Take up what a former process left behind, and begin to work."""
        shutil.rmtree(self._settings.data_dir / "scratch", ignore_errors=True)
        recovered = self._store.recover()
        if recovered:
            log.warning("%d registrations were interrupted", recovered)
        prepare_forkserver(self._settings.threads)
        for thread in self._threads:
            thread.start()

    def notify(self) -> None:
        """A job was added."""
        self._wake.release()

    def kill(self, job_id: str) -> None:
        """End the child of a job that the store has already ended."""
        if job_id in self._running:
            _, child = self._running[job_id]
            child.kill()

    def stop(self) -> None:
        """Begin nothing more, end what runs and hand it back."""
        self._stopping.set()
        for job, child in list(self._running.values()):
            self._store.hand_back(job)
            child.kill()
        for _ in self._threads:
            self._wake.release()
        for thread in self._threads:
            thread.join()

    def _remember(self, job: JobRow, child: Child) -> None:
        self._running[job.id] = (job, child)

    def _serve(self) -> None:
        self._warm_up()
        while not self._stopping.is_set():
            try:
                self._work_or_wait()
            except Exception:
                log.exception("a worker thread met an unexpected error and goes on")
                self._stopping.wait(POLL_S)

    def _work_or_wait(self) -> None:
        job = self._store.claim(lease_s=LEASE_S)
        if job is None:
            self._wake.acquire(timeout=POLL_S)
            return
        try:
            self._worker.work(job)
        finally:
            self._running.pop(job.id, None)

    def _warm_up(self) -> None:
        """Start one child that does nothing, so that the forkserver is loaded before it matters."""
        with contextlib.suppress(ChildLostError):
            child = Child(ready, None)
            try:
                if child.receive(WARM_UP_S) is not None:
                    self._warm.set()
            finally:
                child.close()
