"""Progress is sent when something changes, and stages are timed."""

from __future__ import annotations

import time

import pytest

from service.workers.messages import Progress
from service.workers.progress import ProgressReport


def test_a_change_of_stage_is_sent_at_once_and_the_rest_seldom() -> None:
    sent: list[Progress] = []
    report = ProgressReport(sent.append)
    for stage in ("decode", "search"):
        for fraction in (0.1, 0.2, 0.3):
            report.send(stage, fraction)
    assert sent == [Progress("decode", 0.1), Progress("search", 0.1)]


def test_nothing_is_sent_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("service.workers.progress.PROGRESS_INTERVAL_S", 0.0)
    sent: list[Progress] = []
    report = ProgressReport(sent.append)
    for fraction in (0.1, 0.1, 0.2, 0.2):
        report.send("search", fraction)
    assert sent == [Progress("search", 0.1), Progress("search", 0.2)]


def test_the_fraction_stays_within_bounds() -> None:
    sent: list[Progress] = []
    report = ProgressReport(sent.append)
    report.send("search", 1.0000001)
    report.send("refine", -1e-9)
    assert [message.fraction for message in sent] == [1.0, 0.0]


def test_a_stage_is_timed_even_if_it_fails() -> None:
    report = ProgressReport(lambda _: None)
    with report.stage("decode"):
        time.sleep(0.01)
    with pytest.raises(ZeroDivisionError), report.stage("store"):
        raise ZeroDivisionError
    assert report.timing["decode_s"] >= 0.01
    assert set(report.timing) == {"decode_s", "store_s"}
