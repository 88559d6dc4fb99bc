"""Ends of attempts are logged and counted; jobs that ended without one are not."""

from __future__ import annotations

import logging

import pytest

from service.telemetry.metrics import Metrics
from service.telemetry.recorder import Telemetry
from tests.factories.jobs import new_job


def count(metrics: Metrics, status: str) -> float:
    labels = {"status": status, "error": ""}
    return metrics.registry.get_sample_value("mpe_attempts_total", labels) or 0.0


def test_the_end_of_an_attempt_is_logged_and_counted(caplog: pytest.LogCaptureFixture) -> None:
    telemetry = Telemetry(Metrics(), tracing=None)
    with caplog.at_level(logging.INFO):
        telemetry.ended(new_job(status="succeeded", attempt=1, confidence=0.9))
    assert count(telemetry.metrics, "succeeded") == 1
    assert caplog.messages == ["registration succeeded"]


def test_a_job_that_ended_without_an_attempt_is_not_counted(
    caplog: pytest.LogCaptureFixture,
) -> None:
    telemetry = Telemetry(Metrics(), tracing=None)
    with caplog.at_level(logging.INFO):
        telemetry.ended(new_job(status="cancelled"))
        telemetry.ended(new_job(status="succeeded", cached=True))
        telemetry.changed("a")
    assert count(telemetry.metrics, "cancelled") == count(telemetry.metrics, "succeeded") == 0
    assert caplog.messages == []


def test_only_known_stages_become_labels() -> None:
    """A child that was taken over names what it likes."""
    telemetry = Telemetry(Metrics(), tracing=None)
    timing = {"decode_s": 1.0, "total_s": 2.0} | {f"stage{i}_s": 1.0 for i in range(40)}
    telemetry.ended(new_job(status="succeeded", attempt=1, timing=timing))
    text = telemetry.metrics.exposition()
    assert b'stage="decode"' in text
    assert b"stage7" not in text
