"""Composed pairs: recall beside the peers where next to nothing was tuned, and where ours ends."""

from __future__ import annotations

from matplotlib.figure import Figure

from benchmarks import recall
from benchmarks.comparison import described, settings_text
from benchmarks.composed import composed_pairs
from benchmarks.confidence import judged_attempt, misjudged, verdicts_table
from benchmarks.experiment import Experiment, Result
from benchmarks.methods import AS_DOCUMENTED, GLOBAL
from benchmarks.recall import attempts, overlap_table, recall_table, suite_table

METHODS = [*GLOBAL, *AS_DOCUMENTED]
ASKED = 0.28  # the least overlap in pairs.json
OVERLAPS = (0.15, 0.2, ASKED, 0.4, 0.6, 0.8, 1.0)


def run() -> Result:
    """Measure, and return the figures that the page shows."""
    pairs = composed_pairs()
    judged = [
        {"case": pair["id"], "asked": pair["overlap"] >= ASKED} | judged_attempt(pair, 0)
        for pair in pairs
    ]
    rows = attempts(METHODS, pairs)
    return {"rows": rows, "methods": described(METHODS), "judged": judged}


def table(result: Result) -> str:
    """Return the page's text and tables in Markdown."""
    asked, harder = (
        result | {"rows": [r for r in result["rows"] if (r["overlap"] >= ASKED) == wanted]}
        for wanted in (True, False)
    )
    judged = result["judged"]
    lost = [r for r in judged if r["asked"] and not r["right"]]
    return (
        f"Pairs that pairs.json does not list: where a chain of its pairs leads from one cloud to "
        "another, their poses are composed (A on B and B on C give A on C), both ways round. The "
        "clouds are those of pairs.json, but no setting of a peer was chosen on these pairs. Of "
        "MPL how many rotations and candidates to look at was, and which points the confidence "
        "counts; its weights and all other constants were not. "
        f"{_count(asked)} have the overlap of pairs.json, {ASKED} or more; "
        f"{_count(harder)} have less, down to {OVERLAPS[0]}. Turned and moved as those, one start "
        "each, right by the largest tolerances of the suite; errors of right ones. SAC-IA and RoPS "
        "are left out for their time."
        f"\n{settings_text(result['methods'])}.\n\n"
        f"{recall_table(asked)}\n\n{suite_table(asked)}\n\n"
        f"Not registered right by MPL: {_named(lost)}.\n\n"
        f"## Harder than asked: overlap below {ASKED}\n\n"
        f"{recall_table(harder)}\n\n{suite_table(harder)}\n\n"
        f"## By overlap\n\n{overlap_table(result, OVERLAPS)}\n\n"
        "## What MPL says of its poses\n\n"
        + verdicts_table(
            {
                f"overlap of {ASKED} or more": [r for r in judged if r["asked"]],
                "less": [r for r in judged if not r["asked"]],
            }
        )
        + f"\n\n{misjudged(judged)}"
    )


def _count(result: Result) -> int:
    return len({r["id"] for r in result["rows"]})


def _named(rows: list[Result]) -> str:
    return "; ".join(f"{r['case']} ({r['degrees']:.3g} degrees off)" for r in rows) or "none"


def draw(result: Result, figure: Figure) -> None:
    """Draw the page's picture."""
    recall.draw(result, figure, OVERLAPS)


HELD_OUT = Experiment("held_out", "Real pairs that pairs.json does not list", run, table, draw)
