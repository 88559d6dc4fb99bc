"""Who is told that a job has ended."""

from __future__ import annotations

from dataclasses import dataclass

from service.jobs.model import JobRow
from service.telemetry.metrics import Metrics
from service.telemetry.tracing import Tracing


@dataclass(frozen=True, slots=True)
class Telemetry:
    """Metrics always, spans when they are configured."""

    metrics: Metrics
    tracing: Tracing | None

    def ended(self, job: JobRow) -> None:
        """An attempt has ended the job."""
        self.metrics.ended(job)
        if self.tracing is not None:
            self.tracing.ended(job)

    def close(self) -> None:
        """Export what is left."""
        if self.tracing is not None:
            self.tracing.close()
