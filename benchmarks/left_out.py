"""Real scenes, each family judged by models of the confidence that were fitted to the others."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import product
from unittest import mock

from benchmarks.experiment import RESULTS, Experiment, Result, markdown
from benchmarks.families import Poses, fit, poses_of
from benchmarks.scenes import (
    OURS,
    SCENES,
    SEEDS,
    WITH_VIEWPOINTS,
    our_attempts,
    verdicts,
)
from mpe_core.assess import confidence
from mpe_core.assess.confidence import Model
from tests.factories.clouds import real_trial


def run() -> Result:
    """Measure, and return the figures that the page shows."""
    pairs = json.loads((SCENES / "pairs.json").read_text())
    fitted_to = json.loads((RESULTS / "families.json").read_text())["result"]["rows"]
    blind, seen = (poses_of(fitted_to, seen=known) for known in (False, True))
    rows: list[Result] = []
    for family in dict.fromkeys(pair["suite"] for pair in pairs):
        mine = [pair for pair in pairs if pair["suite"] == family]
        with (
            mock.patch.object(confidence, "MODEL", _without(family, blind, confidence.MODEL)),
            mock.patch.object(
                confidence, "SEEN_MODEL", _without(family, seen, confidence.SEEN_MODEL)
            ),
        ):
            for pair, seed in product(mine, range(SEEDS)):
                trial = real_trial(SCENES, pair, seed=seed)
                rows += [{"suite": family} | row for row in our_attempts(pair, trial)]
    return {"rows": rows}


def _without(family: str, cases: list[Poses], model: Model) -> Model:
    """Fit the model anew to the cases of all other families."""
    found = fit([case for case in cases if case.family != family])
    agreement, small_coverage, shape, violation, layers, intercept = found.score.tolist()
    score, contrast, offset = found.best.tolist()
    return replace(
        model,
        agreement=agreement,
        small_coverage=small_coverage,
        shape=shape,
        violation=-violation,
        layers=-layers,
        intercept=intercept,
        best=(score, contrast, offset),
    )


def table(result: Result) -> str:
    """Return the page's text and tables in Markdown."""
    rows = result["rows"]
    header = ("", "starts", "right", "wrong and accepted", "right but refused", "area under ROC")
    families = dict.fromkeys(row["suite"] for row in rows)
    text = (
        "The pairs of [the scenes](scenes.md), registered by models of the confidence that were"
        " fitted to all families of [families](families.md) but theirs. What was chosen by hand,"
        " such as what counts as a place of full sight, was chosen with some of them in view."
    )
    for name in (OURS, WITH_VIEWPOINTS):
        mine = [row for row in rows if row["method"] == name]
        parts = {family: [row for row in mine if row["suite"] == family] for family in families}
        lines = [verdicts(family, part)[:6] for family, part in parts.items() if part]
        text += f"\n\n## {name}\n\n" + markdown(header, [verdicts("all", mine)[:6], *lines])
    return text


LEFT_OUT = Experiment("left_out", "Scenes, each family left out", run, table)
