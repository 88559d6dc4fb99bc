"""Metrics in the format of Prometheus."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import psutil
from prometheus_client import CollectorRegistry, Counter, Histogram, generate_latest
from prometheus_client.core import GaugeMetricFamily
from prometheus_client.registry import Collector

from mpe_core.machine import available_cores, memory_limit
from service.jobs.missing_workers import MissingWorkers
from service.jobs.model import JobRow
from service.jobs.queries import JobQueries
from service.jobs.worker_slots import WorkerSlots
from service.telemetry.tracing import STAGES

DURATION_BUCKETS_S = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30, 60, 300)
CONFIDENCE_BUCKETS = (0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95, 0.99, 1)
TIMED_STAGES = frozenset((*STAGES, "queued_s", "total_s"))
"""Keys of `JobRow.timing` that are measured."""


class Metrics:
    """Counters and histograms of this process, and gauges of the store, read at each scrape."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        self.requests = Histogram(
            "mpe_http_request_seconds",
            "Time to answer a request.",
            ("method", "route", "status"),
            buckets=DURATION_BUCKETS_S,
            registry=self.registry,
        )
        self.problems = Counter(
            "mpe_problems",
            "Requests that were refused or failed, by type of problem.",
            ("type",),
            registry=self.registry,
        )
        self._ends = Counter(
            "mpe_attempts",
            "Attempts that ended their registration.",
            ("status", "error"),
            registry=self.registry,
        )
        self._fetches = Counter(
            "mpe_fetches",
            "Registrations with clouds from URLs, by whether these were fetched.",
            ("outcome",),
            registry=self.registry,
        )
        self._stages = Histogram(
            "mpe_stage_seconds",
            "Time of each stage of a registration.",
            ("stage",),
            buckets=DURATION_BUCKETS_S,
            registry=self.registry,
        )
        self._confidence = Histogram(
            "mpe_confidence",
            "Confidence of the results.",
            buckets=CONFIDENCE_BUCKETS,
            registry=self.registry,
        )

    def ended(self, job: JobRow) -> None:
        """Count a job that an attempt ended."""
        error = "" if job.error is None else job.error["type"].rpartition(":")[2]
        self._ends.labels(job.status, error).inc()
        for name in TIMED_STAGES & job.timing.keys():  # a label is kept for ever
            seconds = job.timing[name]
            self._stages.labels(name.removesuffix("_s")).observe(seconds)
        if job.confidence is not None:
            self._confidence.observe(job.confidence)
        if job.source.url is not None or job.target.url is not None:
            failed = error.startswith("fetch-") or error == "address-refused"
            self._fetches.labels("failed" if failed else "done").inc()

    def watch(
        self,
        jobs: JobQueries,
        slots: WorkerSlots,
        missing_workers: MissingWorkers,
        is_leader: Callable[[], bool],
    ) -> None:
        """Add gauges of the store and of the memory of this process and its workers.

        Parameters
        ----------
        is_leader
            Returns whether this service leads those on its database.
        """
        self.registry.register(_StateCollector(jobs, slots, missing_workers, is_leader))

    def exposition(self) -> bytes:
        """Return all metrics as text, for a scrape."""
        return generate_latest(self.registry)


class _StateCollector(Collector):
    def __init__(
        self,
        jobs: JobQueries,
        slots: WorkerSlots,
        missing_workers: MissingWorkers,
        is_leader: Callable[[], bool],
    ) -> None:
        self._jobs = jobs
        self._slots = slots
        self._missing_workers = missing_workers
        self._is_leader = is_leader

    def collect(self) -> Iterator[GaugeMetricFamily]:
        jobs = GaugeMetricFamily("mpe_jobs", "Registrations in the store.", labels=["status"])
        for status, number in self._jobs.count_by_status().items():
            jobs.add_metric([status], number)
        yield jobs
        yield GaugeMetricFamily(
            "mpe_queue_age_seconds",
            "Age of the oldest waiting registration.",
            self._jobs.queue_age_s(),
        )
        yield GaugeMetricFamily(
            "mpe_workers",
            "Registrations that all services on the database can run at once.",
            self._slots.count(),
        )
        yield GaugeMetricFamily(
            "mpe_service_workers",
            "Registrations that this service can run at once.",
            self._slots.number,
        )
        labelled = GaugeMetricFamily(
            "mpe_labelled_workers", "Of mpe_workers, those that have a label.", labels=["label"]
        )
        for label, number in self._slots.count_by_label().items():
            labelled.add_metric([label], number)
        yield labelled
        yield GaugeMetricFamily(
            "mpe_jobs_without_worker",
            "Waiting registrations that no running worker can take.",
            sum(self._missing_workers.count().values()),
        )
        yield GaugeMetricFamily(
            "mpe_is_leader",
            "Whether this service cleans up and sends callbacks for all on the database.",
            int(self._is_leader()),
        )
        memory = GaugeMetricFamily(
            "mpe_memory_bytes",
            "Resident memory; shared pages count in each process.",
            labels=["of"],
        )
        process = psutil.Process()
        memory.add_metric(["service"], process.memory_info().rss)
        memory.add_metric(
            ["workers"], sum(_resident_bytes(p) for p in process.children(recursive=True))
        )
        yield memory
        yield GaugeMetricFamily(
            "mpe_memory_limit_bytes",
            "Memory of the machine, or of the container where less.",
            memory_limit(),
        )
        yield GaugeMetricFamily(
            "mpe_cores", "Cores that the service and its workers may use.", available_cores()
        )


def _resident_bytes(process: psutil.Process) -> int:
    try:
        return int(process.memory_info().rss)
    except psutil.NoSuchProcess:
        return 0
