"""Real pairs from any rotation: recall, error and time beside the peers."""

from __future__ import annotations

import json
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from matplotlib.figure import Figure

from benchmarks.comparison import Row, absent, compare, described, measured, settings_text
from benchmarks.experiment import DATA, Experiment, Result, markdown
from benchmarks.methods import AS_DOCUMENTED, GLOBAL, ROPS_GICP, SAC_IA
from tests.clouds import Trial, real_pair

SEEDS = 3
LABELS = ("id", "suite", "overlap", "max_rotation_deg", "max_translation")
ONCE = [*AS_DOCUMENTED, SAC_IA, ROPS_GICP]  # from one start: they take seconds each
KEYS = ("overlap", "right")
OVERLAPS = (0.0, 0.4, 0.6, 0.8, 1.01)


def _trials(seeds: int) -> Iterator[tuple[Row, Trial]]:
    for pair in json.loads((DATA / "pairs.json").read_text()):
        for seed in range(seeds):
            labels = {key: pair[key] for key in LABELS} | {"seed": seed}
            yield labels, real_pair(DATA, pair["id"], seed=seed)


def run() -> Result:
    rows = compare(GLOBAL, _trials(SEEDS)) + compare(ONCE, _trials(1))
    for row in rows:
        row["right"] = bool(
            row["degrees"] <= row["max_rotation_deg"] and row["shift"] <= row["max_translation"]
        )
    return {"rows": rows, "methods": described([*GLOBAL, *ONCE])}


def table(result: Result) -> str:
    rows, names = [], measured(result)
    for name in names:
        mine = [r for r in result["rows"] if r["method"] == name]
        right = [r for r in mine if r["right"]]
        seconds = [r["seconds"] for r in mine]
        rows.append(
            (
                name,
                f"{len(right)}/{len(mine)} ({len(right) / len(mine):.1%})",
                float(np.median([r["degrees"] for r in right])) if right else "-",
                float(np.median(seconds)),
                float(np.quantile(seconds, 0.95)),
            )
        )
    by_suite = [
        (suite, *(_share(result, name, "suite", suite) for name in names))
        for suite in dict.fromkeys(r["suite"] for r in result["rows"])
    ]
    return (
        f"Every pair of pairs.json, turned at random over SO(3) and moved by up to half a "
        f"diagonal, {SEEDS} starts each (one for {', '.join(m.name for m in ONCE)}); right by "
        "the tolerances of the pair; errors of right ones. Peers with the settings of their own "
        "documentation (tutorial, example) and with the best that were found; pip found no package "
        "of TEASER++ (teaserpp, teaserpp-python), Quatro (quatro, pyquatro) or pygicp."
        f"\n{settings_text(result['methods'])}.\n\n"
        + markdown(
            ("method", "right", "median degrees", "median seconds", "95 %"),
            [*rows, *absent(result, 5)],
        )
        + "\n\n"
        + markdown(("suite", *names), by_suite)
    )


def _share(result: Result, method: str, key: str, value: object) -> str:
    right = [r["right"] for r in result["rows"] if r["method"] == method and r[key] == value]
    return f"{sum(right)}/{len(right)}"


def draw(result: Result, figure: Figure) -> None:
    recall, time = figure.subplots(1, 2)
    for name in measured(result):
        mine = [r for r in result["rows"] if r["method"] == name]
        documented = name in {method.name for method in AS_DOCUMENTED}
        bins = [[r for r in mine if low <= r["overlap"] < high] for low, high in pairwise(OVERLAPS)]
        recall.plot(
            *np.transpose([[np.mean([r[key] for r in rows]) for key in KEYS] for rows in bins]),
            "o:" if documented else "o-",
            label=name,
        )
        total = float(np.mean([r["right"] for r in mine]))
        time.plot(float(np.median([r["seconds"] for r in mine])), total, "o", markersize=10)
    recall.set(xlabel="overlap", ylabel="share of pairs registered right", ylim=(0, 1.02))
    figure.legend(loc="outside lower center", ncols=3, fontsize=8)
    time.set(xlabel="seconds, median", xscale="log", ylim=(0, 1.02))


PAIRS = Experiment("pairs", "Real pairs from any rotation", run, table, draw)
