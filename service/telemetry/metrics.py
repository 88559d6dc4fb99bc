"""Metrics in the format of Prometheus."""

from __future__ import annotations

import time
from collections.abc import Iterator

import psutil
from prometheus_client import CollectorRegistry, Counter, Histogram, generate_latest
from prometheus_client.core import GaugeMetricFamily
from prometheus_client.registry import Collector

from mpe_core.machine import available_cores, memory_limit
from service.jobs.model import JOB_STATUSES, JobRow
from service.jobs.queries import JobQueries
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

    def watch(self, jobs: JobQueries) -> None:
        """Add gauges of the store and of the memory of this process and its workers."""
        self.registry.register(_StateCollector(jobs))

    def exposition(self) -> bytes:
        """Return all metrics as text, for a scrape."""
        return generate_latest(self.registry)


class _StateCollector(Collector):
    def __init__(self, jobs: JobQueries) -> None:
        self._jobs = jobs

    def collect(self) -> Iterator[GaugeMetricFamily]:
        jobs = GaugeMetricFamily("mpe_jobs", "Registrations in the store.", labels=["status"])
        for status in JOB_STATUSES:
            jobs.add_metric([status], self._jobs.count(status))
        yield jobs
        oldest = self._jobs.oldest_queued_at()
        age = 0.0 if oldest is None else max(0.0, time.time() - oldest)
        yield GaugeMetricFamily(
            "mpe_queue_age_seconds", "Age of the oldest waiting registration.", age
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
