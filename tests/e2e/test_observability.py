"""Metrics, logs and spans of the running service."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest
from opentelemetry.proto.collector.trace.v1.trace_service_pb2 import ExportTraceServiceRequest
from opentelemetry.proto.trace.v1.trace_pb2 import Span
from prometheus_client.parser import text_string_to_metric_families

from tests.factories.scans import arms, as_npy
from tests.factories.server import Server, running_server
from tests.factories.waiting import until

CLOUD = as_npy(arms(1))


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """Of this file alone: what happens in it is counted."""
    with running_server(tmp_path_factory.mktemp("server")) as running:
        yield running


def samples(server: Server) -> dict[tuple[str, frozenset[tuple[str, str]]], float]:
    text = server.client.get("/metrics").text
    return {
        (sample.name, frozenset(sample.labels.items())): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }


def test_metrics_follow_what_happens(server: Server) -> None:
    server.submit(CLOUD, CLOUD, wait=60, options='{"seed": 1}')
    server.submit(as_npy(arms(1, 1)), CLOUD, wait=60)
    server.submit(b"", CLOUD)
    posts = {"method": "POST", "route": "/v1/registrations"}
    for count, name, labels in (
        (1, "mpe_jobs", {"status": "succeeded"}),
        (1, "mpe_jobs", {"status": "failed"}),
        (1, "mpe_attempts_total", {"status": "succeeded", "error": ""}),
        (1, "mpe_attempts_total", {"status": "failed", "error": "too-few-points"}),
        (1, "mpe_problems_total", {"type": "invalid-request"}),
        (1, "mpe_confidence_count", {}),
        (1, "mpe_stage_seconds_count", {"stage": "refine"}),
        (2, "mpe_stage_seconds_count", {"stage": "decode"}),
        (0, "mpe_queue_age_seconds", {}),
        (1, "mpe_http_request_seconds_count", posts | {"status": "200"}),
        (2, "mpe_http_request_seconds_count", posts | {"status": "422"}),
    ):
        sample = (name, frozenset(labels.items()))
        until(lambda wanted=count, sample=sample: samples(server).get(sample) == wanted)
    for part in ("service", "workers"):
        sample = ("mpe_memory_bytes", frozenset({("of", part)}))
        until(lambda sample=sample: samples(server)[sample] > 10e6)


def test_every_log_line_is_json_and_says_what_it_belongs_to(server: Server) -> None:
    headers = {"X-Request-ID": "order-66"}
    response = server.submit(CLOUD, CLOUD, wait=60, headers=headers, options='{"seed": 2}')
    assert response.headers["X-Request-ID"] == "order-66"
    job_id = response.json()["id"]

    def lines(**said: str) -> list[dict[str, Any]]:
        whole = [json.loads(line) for line in server.log.split("\n")[:-1]]
        return [line for line in whole if said.items() <= line.items()]

    (request,) = until(lambda: lines(request_id="order-66"))
    assert (request["method"], request["path"]) == ("POST", "/v1/registrations")
    assert request["status"] == 200
    assert request["duration_ms"] > 0
    (ended,) = until(lambda: lines(job_id=job_id))
    assert ended["message"] == "registration succeeded"


def test_a_request_id_that_is_no_word_is_replaced(server: Server) -> None:
    response = server.client.get("/livez", headers={"X-Request-ID": "a b\tc"})
    assert response.headers["X-Request-ID"] not in ("", "a b\tc")


class Collector(ThreadingHTTPServer):
    """Keeps the spans that are exported to it."""

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), Traces)
        self.spans: list[Span] = []
        self.url = f"http://127.0.0.1:{self.server_port}/v1/traces"


class Traces(BaseHTTPRequestHandler):
    server: Collector

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["Content-Length"]))
        exported = ExportTraceServiceRequest.FromString(body)
        for resource in exported.resource_spans:
            for scope in resource.scope_spans:
                self.server.spans += scope.spans
        self.send_response(200)
        self.end_headers()

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def collector() -> Iterator[Collector]:
    with Collector() as running:
        threading.Thread(target=running.serve_forever, daemon=True).start()
        yield running
        running.shutdown()


def test_spans_of_a_registration_are_exported(tmp_path: Path, collector: Collector) -> None:
    stages = {"queue", "fetch", "decode", "prepare", "search", "refine", "inliers", "store"}
    with running_server(tmp_path, otlp_endpoint=collector.url) as server:
        job = server.submit(CLOUD, CLOUD, wait=60).json()
        until(lambda: len(collector.spans) > len(stages))
    spans = {span.name: span for span in collector.spans}
    assert set(spans) == {"registration", *stages}
    root = spans["registration"]
    assert {a.key: a.value for a in root.attributes}["mpe.job_id"].string_value == job["id"]
    for name in stages:
        assert spans[name].parent_span_id == root.span_id
        assert spans[name].start_time_unix_nano <= spans[name].end_time_unix_nano
    waited = spans["queue"].end_time_unix_nano - spans["queue"].start_time_unix_nano
    assert waited / 1e9 == pytest.approx(job["timing"]["queued_s"], abs=1e-3)
