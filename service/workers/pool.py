"""Threads that claim waiting jobs and supervise one child process each."""

from __future__ import annotations

import contextlib
import logging
import threading
import time

from service.jobs.model import JobRow
from service.jobs.transitions import JobTransitions
from service.problems import NotReadyError
from service.settings import Settings
from service.storage.blobs import BlobStore
from service.storage.scratch import discard_scratch
from service.telemetry.json_logs import job_context
from service.workers.child import Child, NoProcessError, prepare_forkserver
from service.workers.supervisor import LEASE_S, AttemptSupervisor

POLL_INTERVAL_S = 1.0
"""Interval of the checks for jobs that another service on the same database has accepted."""

log = logging.getLogger(__name__)


class WorkerPool:
    """Runs as many jobs at once as there are workers; the store decides which is next."""

    def __init__(self, transitions: JobTransitions, blobs: BlobStore, settings: Settings) -> None:
        self._transitions = transitions
        self._blobs = blobs
        self._settings = settings
        self._running: dict[str, tuple[JobRow, Child]] = {}
        self._held: set[str] = set()
        self._wake = threading.Semaphore(0)
        self._stopping = threading.Event()
        self._stopped = threading.Event()
        self._warm = threading.Event()
        self._failures: dict[str, str] = {}
        self._threads = [
            threading.Thread(target=self._serve, name=f"worker-{i}", daemon=True)
            for i in range(settings.workers)
        ]

    @property
    def is_ready(self) -> bool:
        """Whether jobs start at once."""
        can_start = len(self._failures) < len(self._threads)
        return self._warm.is_set() and can_start and not self._stopping.is_set()

    @property
    def failure(self) -> str | None:
        """Why a worker cannot start a process; None where all can, or have not tried yet."""
        return next(iter(self._failures.values()), None)

    @property
    def is_stopping(self) -> bool:
        """Whether no further job is started."""
        return self._stopping.is_set()

    @property
    def is_stopped(self) -> bool:
        """Whether all threads have ended, so that no job changes any more."""
        return self._stopped.is_set()

    def held_jobs(self) -> frozenset[str]:
        """Return the ids of the jobs that this pool supervises."""
        return frozenset(self._held)

    def start(self) -> None:
        """Recover the jobs of a killed process and start the threads."""
        lost = self._transitions.requeue_orphans()
        discard_scratch(self._settings.data_dir)
        if lost:
            log.warning("%d registrations were interrupted", lost)
        prepare_forkserver(self._settings.threads)
        for thread in self._threads:
            thread.start()

    def notify(self) -> None:
        """Wake a thread, because a job was added."""
        self._wake.release()

    def kill(self, job_id: str) -> None:
        """Kill the child of a job that the store has already ended."""
        running = self._running.get(job_id)
        if running is not None:
            running[1].kill()

    def stop(self, grace_s: float = 0.0) -> None:
        """Start no further job; kill and requeue what still runs after the grace time."""
        self._stopping.set()
        for _ in self._threads:
            self._wake.release()
        deadline = time.monotonic() + grace_s
        for thread in self._threads:
            thread.join(max(0.0, deadline - time.monotonic()))
        for job, child in list(self._running.values()):
            with contextlib.suppress(NotReadyError):  # its lease ends by itself
                self._transitions.requeue(job)
            child.kill()
        for thread in self._threads:
            thread.join()
        self._stopped.set()

    def _remember(self, job: JobRow, child: Child) -> None:
        self._running[job.id] = (job, child)

    def _serve(self) -> None:
        supervisor = AttemptSupervisor(
            self._transitions, self._blobs, self._settings, self._remember
        )
        while not self._stopping.is_set():
            try:
                if self._prepare(supervisor):
                    self._work_or_wait(supervisor)
            except Exception:
                log.exception("a worker thread met an unexpected error and goes on")
                self._stopping.wait(POLL_INTERVAL_S)
        supervisor.spare.close()

    def _prepare(self, supervisor: AttemptSupervisor) -> bool:
        """Wait a moment for the next process; return whether it is ready."""
        name = threading.current_thread().name
        try:
            is_ready = supervisor.spare.wait_until_ready(POLL_INTERVAL_S)
        except NoProcessError as error:
            if self._failures.get(name) != str(error):
                log.error("a worker cannot start a process, and tries again: %s", error)
            self._failures[name] = str(error)
            self._stopping.wait(POLL_INTERVAL_S)
            return False
        if is_ready:
            self._failures.pop(name, None)
            self._warm.set()
        return is_ready

    def _work_or_wait(self, supervisor: AttemptSupervisor) -> None:
        job = self._transitions.claim(lease_s=LEASE_S)
        if job is None:
            self._wake.acquire(timeout=POLL_INTERVAL_S)
            return
        self._held.add(job.id)
        try:
            with job_context(job.id):
                supervisor.run_attempt(job)
        finally:
            self._running.pop(job.id, None)
            self._held.discard(job.id)
