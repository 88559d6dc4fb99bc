"""Real pairs from any rotation: recall, error and time beside the peers."""

from __future__ import annotations

import json

from matplotlib.figure import Figure

from benchmarks import recall
from benchmarks.comparison import described, settings_text
from benchmarks.experiment import DATA, Experiment, Result
from benchmarks.methods import AS_DOCUMENTED, GLOBAL, ROPS_GICP, SAC_IA
from benchmarks.recall import attempts, recall_table, suite_table

SEEDS = 3
ONCE = [*AS_DOCUMENTED, SAC_IA, ROPS_GICP]  # from one start: they take seconds each
OVERLAPS = (0.0, 0.4, 0.6, 0.8, 1.0)


def run() -> Result:
    """Measure, and return the figures that the page shows."""
    pairs = json.loads((DATA / "pairs.json").read_text())
    rows = attempts(GLOBAL, pairs, SEEDS) + attempts(ONCE, pairs)
    return {"rows": rows, "methods": described([*GLOBAL, *ONCE])}


def table(result: Result) -> str:
    """Return the page's text and tables in Markdown."""
    return (
        f"Every pair of pairs.json, turned at random over SO(3) and moved by up to half a "
        f"diagonal, {SEEDS} starts each (one for {', '.join(m.name for m in ONCE)}); right by "
        "the tolerances of the pair; errors of right ones. Peers with the settings of their own "
        "documentation (tutorial, example) and with the best that were found; pip found no package "
        "of TEASER++ (teaserpp, teaserpp-python), Quatro (quatro, pyquatro) or pygicp."
        f"\n{settings_text(result['methods'])}.\n\n"
        f"{recall_table(result)}\n\n{suite_table(result)}"
    )


def draw(result: Result, figure: Figure) -> None:
    """Draw the page's picture."""
    recall.draw(result, figure, OVERLAPS)


PAIRS = Experiment("pairs", "Real pairs from any rotation", run, table, draw)
