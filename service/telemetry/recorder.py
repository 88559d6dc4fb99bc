"""Logs, metrics and spans of the jobs that end."""

from __future__ import annotations

import logging
from dataclasses import dataclass

from service.jobs.model import JobRow
from service.telemetry.json_logs import job_context
from service.telemetry.metrics import Metrics
from service.telemetry.tracing import Tracing

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Telemetry:
    """JobListener that records ends; spans only if MPE_OTLP_ENDPOINT is set."""

    metrics: Metrics
    tracing: Tracing | None

    def changed(self, job_id: str) -> None:
        """Do nothing: only ends are recorded."""

    def ended(self, job: JobRow) -> None:
        """Record the end of a job, unless no attempt was made at it."""
        if job.attempt == 0:
            return
        with job_context(job.id):
            log.info("registration %s", job.status, extra={"attempt": job.attempt})
        self.metrics.ended(job)
        if self.tracing is not None:
            self.tracing.ended(job)

    def close(self) -> None:
        """Export the spans that are left."""
        if self.tracing is not None:
            self.tracing.close()
