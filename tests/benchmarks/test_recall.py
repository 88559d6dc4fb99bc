"""What the pages on recall count."""

import json

import numpy as np
import pytest

pytest.importorskip("matplotlib")
from benchmarks import held_out
from benchmarks.comparison import binned
from benchmarks.held_out import ASKED, OVERLAPS, table
from benchmarks.methods import MPL, Method
from benchmarks.recall import attempts, is_right, overlap_table, recall_table, suite_table

LAID = Method("laid", "1", lambda source, target: np.eye(4), "as they come")
METHOD = {"version": "1", "settings": "none"}


def row(name, overlap, right, suite="dragon"):
    return {
        "id": f"{suite}_{overlap}",
        "suite": suite,
        "overlap": overlap,
        "method": name,
        "right": right,
        "degrees": 0.5,
        "shift": 0.01,
        "seconds": 0.25,
    }


def judged_row(case, *, asked, right):
    errors = {"right": right, "degrees": 0.5, "shift": 0.01}
    return {"case": case, "asked": asked, "confidence": 0.6, "accepted": True} | errors


def cells(text):
    return [[cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines()]


@pytest.fixture
def result():
    rows = [row("a", 0.2, False), row("a", 0.5, True), row("a", 1.0, True, "bunny")]
    rows += [row("b", 0.2, False), row("b", 0.5, False), row("b", 1.0, True, "bunny")]
    return {"rows": rows, "methods": {"a": METHOD, "b": METHOD}}


def test_only_a_pose_within_the_tolerances_is_right(data):
    pairs = json.loads((data / "pairs.json").read_text())
    pair = next(pair for pair in pairs if pair["suite"] == "bunny_rgbd")
    rows = attempts([MPL, LAID], [pair])
    assert [(r["method"], r["right"], r["seed"]) for r in rows] == [
        ("MPL", True, 0),
        ("laid", False, 0),
    ]
    assert is_right(pair, pair["max_rotation_deg"], pair["max_translation"])
    assert not is_right(pair, 1.01 * pair["max_rotation_deg"], 0.0)
    assert not is_right(pair, 0.0, 1.01 * pair["max_translation"])


def test_shares_of_methods_suites_and_overlaps(result):
    recall, suites = cells(recall_table(result)), cells(suite_table(result))
    assert [line[1] for line in recall[2:]] == ["2/3 (66.7%)", "1/3 (33.3%)"]
    assert suites[2:] == [["dragon", "1/2", "0/2"], ["bunny", "1/1", "1/1"]]
    overlaps = cells(overlap_table(result, (0.0, 0.4, 0.8, 0.9, 1.0)))
    assert overlaps[2:] == [
        ["0 to 0.4", "0/1", "0/1"],
        ["0.4 to 0.8", "1/1", "0/1"],
        ["0.9 to 1", "1/1", "1/1"],
    ]


def test_an_edge_belongs_to_the_bin_above_it_and_the_last_one_to_the_last():
    rows = [{"value": value} for value in (0.0, 0.5, 1.0)]
    assert binned(rows, "value", (0.0, 0.5, 1.0)) == [(0.0, 0.5, rows[:1]), (0.5, 1.0, rows[1:])]


def test_less_overlap_than_asked_is_counted_apart(result):
    judged = [
        judged_row("dragon_0.2", asked=False, right=False),
        judged_row("dragon_0.5", asked=True, right=True),
        judged_row("bunny_1.0", asked=True, right=True),
    ]
    asked, harder = table(result | {"judged": judged}).split("## Harder than asked")
    assert OVERLAPS[0] <= 0.2 < ASKED
    assert "| a | 2/2 (100.0%) |" in asked
    assert "| a | 0/1 (0.0%) |" in harder
    assert "Wrong, but accepted: dragon_0.2 (0.60)." in harder
    assert f"| overlap of {ASKED} or more | 2 | 0 |" in harder


def test_a_run_judges_each_pair_it_attempts(data, monkeypatch):
    pairs = json.loads((data / "pairs.json").read_text())
    easy, hard = [pair for pair in pairs if pair["suite"] == "bunny_rgbd"][:2]
    monkeypatch.setattr(held_out, "composed_pairs", lambda: [easy, hard | {"overlap": 0.2}])
    monkeypatch.setattr(held_out, "METHODS", [MPL, LAID])
    result = held_out.run()
    assert [(r["case"], r["asked"], r["right"]) for r in result["judged"]] == [
        (easy["id"], True, True),
        (hard["id"], False, True),
    ]
    asked, harder = table(result).split("## Harder than asked")
    for page in (asked, harder):
        assert "| MPL | 1/1 (100.0%) |" in page
        assert "| laid | 0/1 (0.0%) |" in page
    assert f"| overlap of {ASKED} or more | 1 | 0 | - | - | 0/1 (0.0%) |" in harder
