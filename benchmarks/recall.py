"""Recall of the methods on real pairs: trials, tables and picture."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from matplotlib.figure import Figure

from benchmarks.comparison import Row, absent, binned, compare, measured
from benchmarks.experiment import DATA, Result, markdown
from benchmarks.methods import AS_DOCUMENTED, Method
from tests.factories.clouds import Pair, Trial, real_trial

LABELS = ("id", "suite", "overlap", "max_rotation_deg", "max_translation")
KEYS = ("overlap", "right")


def attempts(methods: Sequence[Method], pairs: Iterable[Pair], seeds: int = 1) -> list[Row]:
    """Return the rows of `compare` on each pair from `seeds` starts, with whether it is right."""
    rows = compare(methods, _trials(pairs, seeds))
    for row in rows:
        row["right"] = is_right(row, row["degrees"], row["shift"])
    return rows


def _trials(pairs: Iterable[Pair], seeds: int) -> Iterator[tuple[Row, Trial]]:
    for pair in pairs:
        for seed in range(seeds):
            labels = {key: pair[key] for key in LABELS} | {"seed": seed}
            yield labels, real_trial(DATA, pair, seed=seed)


def is_right(pair: Pair, degrees: float, shift: float) -> bool:
    """Whether the errors are within the tolerances of the pair."""
    return bool(degrees <= pair["max_rotation_deg"] and shift <= pair["max_translation"])


def recall_table(result: Result) -> str:
    """Return a table of each method: right poses, their error, seconds."""
    rows = []
    for name in measured(result):
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
    columns = ("method", "right", "median degrees", "median seconds", "95 %")
    return markdown(columns, [*rows, *absent(result, len(columns))])


def suite_table(result: Result) -> str:
    """Return a table of each suite: right poses of each method."""
    suites = dict.fromkeys(r["suite"] for r in result["rows"])
    return _shares(
        result, "suite", {s: [r for r in result["rows"] if r["suite"] == s] for s in suites}
    )


def overlap_table(result: Result, edges: Sequence[float]) -> str:
    """Return a table of each range of the overlap: right poses of each method."""
    bins = binned(result["rows"], "overlap", edges)
    return _shares(result, "overlap", {f"{low:g} to {high:g}": mine for low, high, mine in bins})


def _shares(result: Result, heading: str, groups: dict[str, list[Row]]) -> str:
    names = measured(result)
    return markdown(
        (heading, *names),
        [(group, *(_share(rows, name) for name in names)) for group, rows in groups.items()],
    )


def _share(rows: list[Row], method: str) -> str:
    right = [r["right"] for r in rows if r["method"] == method]
    return f"{sum(right)}/{len(right)}"


def draw(result: Result, figure: Figure, edges: Sequence[float]) -> None:
    """Draw the share of right poses over the overlap, and over the time."""
    recall, time = figure.subplots(1, 2)
    for name in measured(result):
        mine = [r for r in result["rows"] if r["method"] == name]
        documented = name in {method.name for method in AS_DOCUMENTED}
        bins = [rows for _, _, rows in binned(mine, "overlap", edges)]
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
