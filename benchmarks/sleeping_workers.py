"""Workers that do all that a worker does with database and store, and sleep for the rest."""

from __future__ import annotations

import hashlib
import multiprocessing
import os
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from multiprocessing.queues import Queue
from pathlib import Path
from typing import Any

from sqlalchemy import Engine, event

from service.clouds.inputs import CloudInput
from service.database.engine import Database, open_database
from service.jobs.model import JobRow
from service.jobs.transitions import JobTransitions
from service.settings import BlobSettings
from service.storage.bucket import Bucket
from service.storage.s3_blobs import S3BlobStore
from service.workers.lease import HEARTBEAT_SHARE
from service.workers.supervisor import POLL_INTERVAL_S
from tests.factories.jobs import OUTCOME, new_job, open_transitions

TENANTS = 10
CLOUD_BYTES, RESULT_BYTES, INLIERS_BYTES = 7_300, 2_000, 7_300
"""Lengths of the files of a registration of 300 points."""
LEASE_S = 10.0
STAGES = ("decode", "prepare", "search", "refine", "inliers")
THREADS_PER_PROCESS = 16
"""Sleeping workers of one process: more would wait for each other's interpreter."""
CACHE_BYTES, GRACE_S = 1 << 30, 600.0


@dataclass(frozen=True)
class Load:
    """Jobs to run, by how many workers, and how long each takes them."""

    workers: int
    sleep_s: float | None
    jobs: int

    @property
    def ideal_per_s(self) -> float:
        """Jobs a second of workers that wait for nothing."""
        assert self.sleep_s is not None
        return self.workers / self.sleep_s

    def with_sleep(self, sleep_s: float) -> Load:
        """Return the load with this sleep, unless it has one."""
        return self if self.sleep_s is not None else replace(self, sleep_s=sleep_s)


@dataclass(frozen=True)
class Costs:
    """What a run took."""

    seconds: float
    round_trips: int
    """Of the workers to the database."""
    cpu_s: float
    """Processor time of the workers."""


def drain(load: Load, database: Database, url: str, blob: BlobSettings) -> Costs:
    """Queue the jobs, let the workers run them, and measure."""
    with tempfile.TemporaryDirectory() as directory:
        source = _store_cloud(Path(directory), blob)
        transitions = open_transitions(database, queue_limit=10 * load.jobs)
        for number in range(load.jobs):
            job = new_job(tenant=f"t{number % TENANTS}", source=source, target=source)
            transitions.add(job)
        with _processes(load, url, blob) as (start, results, number):
            start.wait()  # every process has its connections and its cloud
            started = time.perf_counter()
            answers = [results.get() for _ in range(number)]
            seconds = max(answer["ended_at"] for answer in answers) - started
    return Costs(seconds, sum(a["round_trips"] for a in answers), sum(a["cpu_s"] for a in answers))


def _store_cloud(directory: Path, blob: BlobSettings) -> CloudInput:
    stored = _open_blobs(directory, blob).put([os.urandom(CLOUD_BYTES)])
    return CloudInput(sha256=stored.sha256, size=stored.size)


def _open_blobs(directory: Path, blob: BlobSettings) -> S3BlobStore:
    return S3BlobStore(directory, Bucket(blob), cache_bytes=CACHE_BYTES, grace_s=GRACE_S)


@contextmanager
def _processes(
    load: Load, url: str, blob: BlobSettings
) -> Iterator[tuple[Any, Queue[dict[str, float]], int]]:
    """Start processes with the workers; yield a barrier, their answers, and their number."""
    context = multiprocessing.get_context("spawn")
    threads = [
        min(THREADS_PER_PROCESS, load.workers - begun)
        for begun in range(0, load.workers, THREADS_PER_PROCESS)
    ]
    barrier, results = context.Barrier(len(threads) + 1), context.Queue()
    processes = [
        context.Process(target=_work, args=(number, load, url, blob, barrier, results))
        for number in threads
    ]
    for process in processes:
        process.start()
    try:
        yield barrier, results, len(threads)
    finally:
        for process in processes:
            process.join()


def _work(
    threads: int, load: Load, url: str, blob: BlobSettings, barrier: Any, results: Any
) -> None:
    round_trips = [0]

    def count(_connection: object, _cursor: object, statement: str, *_: object) -> None:
        round_trips[0] += 2 if statement.startswith("BEGIN") else 1  # it has a COMMIT

    with tempfile.TemporaryDirectory() as directory, closing(open_database(url)) as database:
        worker = SleepingWorkers(database, _open_blobs(Path(directory), blob), load)
        event.listen(Engine, "before_cursor_execute", count)
        barrier.wait()
        before_s = time.process_time()
        worker.run(threads)
        answer = {"ended_at": worker.ended_at, "round_trips": round_trips[0]}
        results.put({**answer, "cpu_s": time.process_time() - before_s})


class SleepingWorkers:
    """The workers of one process; they end when nothing waits any more."""

    def __init__(self, database: Database, blobs: S3BlobStore, load: Load) -> None:
        self._transitions: JobTransitions = open_transitions(database, queue_limit=10 * load.jobs)
        self._blobs = blobs
        self._sleep_s = load.sleep_s or 0.0
        self.ended_at = time.perf_counter()

    def run(self, number: int) -> None:
        """Run jobs in so many threads until none is left."""
        threads = [threading.Thread(target=self._work) for _ in range(number)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()

    def _work(self) -> None:
        while (job := self._transitions.claim(lease_s=LEASE_S)) is not None:
            assert job.source.sha256 is not None
            with self._blobs.hold(job.source.sha256):
                self._sleep(job)
            self._commit(job)
            self.ended_at = time.perf_counter()

    def _sleep(self, job: JobRow) -> None:
        """Sleep, with the looks, leases and progress of an attempt."""
        for stage in STAGES:
            self._transitions.record_progress(job, stage, 0.5)
        ends_at = time.monotonic() + self._sleep_s
        next_heartbeat = time.monotonic() + HEARTBEAT_SHARE * LEASE_S
        while (left_s := ends_at - time.monotonic()) > 0:
            time.sleep(min(left_s, POLL_INTERVAL_S))
            self._transitions.is_current(job)
            if time.monotonic() >= next_heartbeat:
                self._transitions.extend_lease(job, lease_s=LEASE_S)
                next_heartbeat = time.monotonic() + HEARTBEAT_SHARE * LEASE_S

    def _commit(self, job: JobRow) -> None:
        result = self._blobs.put([os.urandom(RESULT_BYTES)])
        inliers = self._blobs.put([os.urandom(INLIERS_BYTES)])
        outcome = replace(
            OUTCOME,
            result_sha256=result.sha256,
            inliers_sha256=inliers.sha256,
            source=job.source,
            target=job.target,
        )
        key = hashlib.sha256(job.id.encode()).hexdigest()
        assert self._transitions.succeed(job, outcome, key)
