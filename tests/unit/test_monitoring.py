"""The dashboard and the alerts ask for metrics and labels that the service has."""

from __future__ import annotations

import json
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml

from service.jobs.model import JOB_STATUSES
from service.problems import all_problem_types
from service.telemetry.metrics import Metrics

DEPLOY = Path(__file__).parent.parent.parent / "deploy"
OPERATIONS = DEPLOY.parent / "docs" / "operations.md"
ALERTS: list[dict[str, Any]] = [
    rule
    for group in yaml.safe_load((DEPLOY / "alerts.yaml").read_text())["groups"]
    for rule in group["rules"]
]
DASHBOARD = json.loads((DEPLOY / "grafana.json").read_text())
EXPRESSIONS = [
    *(alert["expr"] for alert in ALERTS),
    *(target["expr"] for panel in DASHBOARD["panels"] for target in panel["targets"]),
]
SUFFIXES = re.compile(r"_(bucket|count|sum|total)$")
OF_THE_SCRAPE = {"instance", "job", "le"}


@pytest.fixture(scope="module")
def known() -> dict[str, set[str]]:
    """Labels of each metric, by its name without a suffix."""
    metrics = Metrics()
    counts = dict.fromkeys(JOB_STATUSES, 0)
    jobs: Any = SimpleNamespace(count_by_status=lambda: counts, queue_age_s=lambda: 0.0)
    slots: Any = SimpleNamespace(count=lambda: 0, number=0, count_by_label=lambda: {"large": 1})
    missing: Any = SimpleNamespace(count=dict)
    metrics.watch(jobs, slots, missing, lambda: False)
    labels = {
        each._name: set(each._labelnames)
        for each in vars(metrics).values()
        if hasattr(each, "_labelnames")
    }
    for family in metrics.registry.collect():
        labels.setdefault(family.name, {name for s in family.samples for name in s.labels})
    return labels


@pytest.mark.parametrize("expression", EXPRESSIONS)
def test_expressions_ask_for_what_there_is(expression: str, known: dict[str, set[str]]) -> None:
    for opening, closing in ("()", "{}", "[]"):
        assert expression.count(opening) == expression.count(closing)
    named = re.findall(r"\b(mpe_\w+)(?:\{([^}]*)\})?", expression)
    assert named or expression.startswith(("up", "sum(up"))
    for name, selector in named:
        metric = SUFFIXES.sub("", name)
        assert metric in known
        assert set(re.findall(r"(\w+)\s*[=!]", selector)) <= known[metric] | OF_THE_SCRAPE


def test_types_of_problems_exist() -> None:
    types = {kind.slug for kind in all_problem_types()}
    named = [
        word for each in EXPRESSIONS for word in re.findall(r'(?:type=~|error=)"([^"]+)', each)
    ]
    assert {name for words in named for name in words.split("|")} <= types


def test_each_alert_says_what_to_do() -> None:
    told = set(re.findall(r"^\| `(Mpe\w+)` \|", OPERATIONS.read_text(), re.M))
    assert told == {alert["alert"] for alert in ALERTS}
    for alert in ALERTS:
        assert alert["labels"]["severity"] in ("critical", "warning", "info")
        assert alert["annotations"]["summary"]


def test_the_panels_do_not_overlap() -> None:
    seen: set[tuple[int, int]] = set()
    for panel in DASHBOARD["panels"]:
        x, y, w, h = (panel["gridPos"][name] for name in "xywh")
        cells = {(x + i, y + j) for i in range(w) for j in range(h)}
        assert not cells & seen
        assert x + w <= 24
        seen |= cells
