"""Threads that claim waiting jobs of a queue and supervise one child process each."""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from typing import get_args

from service.jobs.claim_order import NO_LIMIT
from service.jobs.model import JobQueue, JobRow
from service.jobs.sizes import served_queues
from service.jobs.transitions import JobTransitions
from service.problems import NotReadyError
from service.settings import Settings
from service.storage.blobs import BlobStore
from service.storage.scratch import discard_scratch
from service.telemetry.json_logs import job_context
from service.workers.child import Child, NoProcessError, prepare_forkserver
from service.workers.supervisor import AttemptSupervisor

POLL_INTERVAL_S = 1.0
"""Interval of the checks for jobs that another service on the same database has accepted."""

STOP_S = 10.0
"""Time that threads have to end once their children are killed, in seconds."""

_Claim = tuple[str, JobQueue]
"""Id of a job, and the queue that it was claimed from: the second claim may overlap with the end of
the first."""

log = logging.getLogger(__name__)


class WorkerPool:
    """Runs as many jobs at once as there are workers; the store decides which is next.

    Clouds are fetched by threads of their own, so that a slow host holds no worker. A tenant gets
    no more of them than it leaves free. So one is always free for a tenant that has none yet.

    Parameters
    ----------
    runs_jobs : bool
        Whether it has workers at all; otherwise other services run the jobs.
    """

    def __init__(
        self,
        transitions: JobTransitions,
        blobs: BlobStore,
        settings: Settings,
        *,
        runs_jobs: bool = True,
    ) -> None:
        self._transitions = transitions
        self._blobs = blobs
        self._settings = settings
        self._running: dict[_Claim, tuple[JobRow, Child]] = {}
        self._held: set[_Claim] = set()
        self._claiming = threading.Lock()
        self._queues = served_queues(settings.worker_labels)
        wake_workers = threading.Semaphore(0)
        self._wake = dict.fromkeys(get_args(JobQueue), wake_workers)
        self._wake["fetch"] = threading.Semaphore(0)
        self._leaving = threading.Event()
        self._stopping = threading.Event()
        self._stopped = threading.Event()
        self._warm = threading.Event()
        self._failures: dict[str, str] = {}
        self._workers = self._make_threads("register", "worker", settings.workers * runs_jobs)
        fetchers = self._make_threads("fetch", "fetcher", settings.url.concurrency * runs_jobs)
        self._threads = [*self._workers, *fetchers]

    def _make_threads(self, queue: JobQueue, name: str, number: int) -> list[threading.Thread]:
        return [
            threading.Thread(target=self._serve, args=(queue,), name=f"{name}-{i}", daemon=True)
            for i in range(number)
        ]

    @property
    def is_ready(self) -> bool:
        """Whether jobs start at once; those of a pool that runs none start elsewhere."""
        if self._leaving.is_set() or self._stopping.is_set():
            return False
        can_start = any(thread.name not in self._failures for thread in self._workers)
        return not self._workers or (self._warm.is_set() and can_start)

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
        return frozenset(job_id for job_id, _ in list(self._held))

    def start(self) -> None:
        """Recover the jobs of a killed process and start the threads."""
        lost = self._transitions.requeue_orphans()
        discard_scratch(self._settings.data_dir)
        if lost:
            log.warning("%d registrations were interrupted", lost)
        prepare_forkserver(self._settings.threads)
        for thread in self._threads:
            thread.start()

    def notify(self, queue: JobQueue) -> None:
        """Wake a thread, because a job was added to the queue."""
        self._wake[queue].release()

    def notify_all(self) -> None:
        """Wake all threads, because jobs may have been added."""
        for wake in set(self._wake.values()):
            wake.release(max(1, len(self._threads)))

    def kill(self, job_id: str) -> None:
        """Kill the child of a job that the store has already ended."""
        for job, child in list(self._running.values()):
            if job.id == job_id:
                child.kill()

    def leave(self) -> None:
        """Be ready no longer, and go on as before until `stop`."""
        self._leaving.set()

    def stop(self, grace_s: float = 0.0) -> None:
        """Start no further job; kill and requeue what still runs after the grace time.

        A thread that waits for a file of a store that does not answer is left: what it does later
        counts no more.
        """
        self._stopping.set()
        self.notify_all()
        deadline = time.monotonic() + grace_s
        for thread in self._threads:
            thread.join(max(0.0, deadline - time.monotonic()))
        for job, child in list(self._running.values()):
            with contextlib.suppress(NotReadyError):  # its lease ends by itself
                self._transitions.requeue(job)
            child.kill()
        deadline = time.monotonic() + STOP_S
        for thread in self._threads:
            thread.join(max(0.0, deadline - time.monotonic()))
        left = sum(thread.is_alive() for thread in self._threads)
        if left:
            log.warning("%d worker threads did not end within %g s and are left", left, STOP_S)
        self._stopped.set()

    def _remember(self, job: JobRow, child: Child) -> None:
        self._running[job.id, job.queue] = (job, child)

    def _serve(self, queue: JobQueue) -> None:
        supervisor = AttemptSupervisor(
            self._transitions,
            self._blobs,
            self._settings,
            started=self._remember,
            fetched=lambda: self.notify("register"),
        )
        serve = self._register if queue == "register" else self._fetch
        while not self._stopping.is_set():
            try:
                serve(supervisor)
            except NotReadyError:  # logged where it is met
                self._stopping.wait(POLL_INTERVAL_S)
            except Exception:
                log.exception("a worker thread met an unexpected error and goes on")
                self._stopping.wait(POLL_INTERVAL_S)
        supervisor.spare.close()

    def _register(self, supervisor: AttemptSupervisor) -> None:
        """Run a job, or wait for one; its process is ready before it is claimed."""
        if not self._prepare(supervisor):
            return
        self._warm.set()
        for queue in self._queues:
            is_claimable = self._transitions.is_claimable(queue)  # most wakes are for others
            if is_claimable and self._work(supervisor, queue):
                return
        self._wait_for_jobs("register")

    def _fetch(self, supervisor: AttemptSupervisor) -> None:
        """Fetch the clouds of a job, or wait for one; a process is started where one is needed."""
        if not self._transitions.is_claimable("fetch", self._free_fetchers()):
            self._wait_for_jobs("fetch")
        elif self._prepare(supervisor):
            self._work(supervisor, "fetch")

    def _free_fetchers(self) -> int:
        busy = sum(queue == "fetch" for _, queue in list(self._held))
        return self._settings.url.concurrency - busy

    def _wait_for_jobs(self, queue: JobQueue) -> None:
        self._wake[queue].acquire(timeout=POLL_INTERVAL_S)

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
        return is_ready

    def _work(self, supervisor: AttemptSupervisor, queue: JobQueue) -> bool:
        """Run an attempt at the next job; return False when there is none."""
        job = self._claim(queue)
        if job is None:
            return False
        claim = (job.id, queue)
        try:
            with job_context(job.id):
                supervisor.run_attempt(job)
        finally:
            self._running.pop(claim, None)
            self._held.discard(claim)
        return True

    def _claim(self, queue: JobQueue) -> JobRow | None:
        """Claim the next job; one thread at a time, so that no two count the same fetcher free."""
        with self._claiming:
            tenant_limit = self._free_fetchers() if queue == "fetch" else NO_LIMIT
            job = self._transitions.claim(queue, tenant_limit, lease_s=self._settings.lease_s)
            if job is not None:
                self._held.add((job.id, queue))
        return job
