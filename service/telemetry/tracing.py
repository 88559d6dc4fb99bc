"""Spans of each registration, exported by OTLP to MPE_OTLP_ENDPOINT."""

from __future__ import annotations

from typing import TYPE_CHECKING

from service.jobs.model import JobRow

if TYPE_CHECKING:
    from opentelemetry.sdk.trace import TracerProvider

STAGES = ("fetch_s", "decode_s", "prepare_s", "search_s", "refine_s", "inliers_s", "store_s")


class Tracing:
    """Export spans in the background; needs the extra `telemetry`."""

    def __init__(self, endpoint: str) -> None:
        self._provider = _provider(endpoint)
        self._tracer = self._provider.get_tracer("mpe")

    def ended(self, job: JobRow) -> None:
        """Record a span of the job, with children for the time in the queue and each stage."""
        from opentelemetry import trace

        assert job.started_at is not None  # noqa: S101
        assert job.finished_at is not None  # noqa: S101
        root = self._tracer.start_span("registration", start_time=_nanoseconds(job.created_at))
        root.set_attribute("mpe.job_id", job.id)
        root.set_attribute("mpe.status", job.status)
        if job.confidence is not None:
            root.set_attribute("mpe.confidence", job.confidence)
        below = trace.set_span_in_context(root)
        queued_s = job.timing.get("queued_s", job.started_at - job.created_at)
        spans = [("queue", job.created_at, job.created_at + queued_s)]
        for stage in STAGES:
            begin = spans[-1][2]
            spans.append((stage.removesuffix("_s"), begin, begin + job.timing.get(stage, 0.0)))
        for name, begin, end in spans:
            span = self._tracer.start_span(name, context=below, start_time=_nanoseconds(begin))
            span.end(_nanoseconds(end))
        root.end(_nanoseconds(job.finished_at))

    def close(self) -> None:
        """Export the spans that are left."""
        self._provider.shutdown()


def _provider(endpoint: str) -> TracerProvider:
    try:
        from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter
        from opentelemetry.sdk.resources import Resource
        from opentelemetry.sdk.trace import TracerProvider
        from opentelemetry.sdk.trace.export import BatchSpanProcessor
    except ImportError as error:
        raise RuntimeError(
            "MPE_OTLP_ENDPOINT needs the extra telemetry: pip install 'mpe[telemetry]'"
        ) from error
    provider = TracerProvider(resource=Resource.create({"service.name": "mpe"}))
    provider.add_span_processor(BatchSpanProcessor(OTLPSpanExporter(endpoint)))
    return provider


def _nanoseconds(seconds: float) -> int:
    return int(seconds * 1e9)
