"""Several methods on the same trials."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes

from benchmarks.experiment import timed
from benchmarks.methods import Method
from tests.factories.checks import pose_error
from tests.factories.clouds import Trial

Row = dict[str, Any]


def compare(methods: Sequence[Method], trials: Iterable[tuple[Row, Trial]]) -> list[Row]:
    """Run methods on trials; return a row for each: labels, method, errors and seconds.

    `degrees` is the rotation error of Eq. 11, `shift` the distance between the source's centroids
    under the found and the true pose (Eq. 12 about the centroid, which makes it independent of the
    origin of the coordinates).
    A method that is not installed has no rows.
    """
    for method in methods:
        if not method.version:
            print(f"!!! {method.name} IS NOT INSTALLED: no figures; `make peers`", file=sys.stderr)
    present = [method for method in methods if method.version]
    rows = []
    for labels, trial in trials:
        for method in present:
            T, seconds = timed(method.register, trial.source, trial.target)
            degrees, shift = pose_error(T, trial.T_target_source, trial.source)
            rows.append(
                {
                    **labels,
                    "method": method.name,
                    "degrees": degrees,
                    "shift": shift,
                    "seconds": seconds,
                }
            )
    return rows


def described(methods: Sequence[Method]) -> dict[str, dict[str, str | None]]:
    """Return version and settings of each method by its name."""
    return {m.name: {"version": m.version, "settings": m.settings} for m in methods}


def settings_text(methods: dict[str, dict[str, str | None]]) -> str:
    """Return one line with the version and the settings of every method."""
    return "; ".join(
        f"{name} ({m['version'] or 'NOT INSTALLED'}): {m['settings']}"
        for name, m in methods.items()
    )


def values(rows: Iterable[Row], value: str, **labels: object) -> np.ndarray:
    """Return the (K,) values of the rows with these labels."""
    return np.array(
        [row[value] for row in rows if all(row[key] == label for key, label in labels.items())]
    )


def binned(
    rows: Iterable[Row], value: str, edges: Sequence[float]
) -> list[tuple[float, float, list[Row]]]:
    """Sort rows into the bins between neighboring edges, by one of their values.

    Returns
    -------
    Lower edge, upper edge and rows of each bin that has any. A bin includes its lower edge; the
    last one includes both.
    """
    rows, last = list(rows), edges[-1]
    found = [
        (low, high, [r for r in rows if low <= r[value] < high or r[value] == high == last])
        for low, high in pairwise(edges)
    ]
    return [(low, high, mine) for low, high, mine in found if mine]


def measured(result: dict[str, Any]) -> list[str]:
    """Return the names of the methods that have rows."""
    names = {row["method"] for row in result["rows"]}
    return [name for name in result["methods"] if name in names]


def absent(result: dict[str, Any], columns: int) -> list[tuple[str, ...]]:
    """Return a table row for each method that is not installed."""
    methods = result["methods"]
    return [
        (name, *["not installed"] * (columns - 1))
        for name in methods
        if not methods[name]["version"]
    ]


def by_method(rows: list[Row], value: str, key: str, names: Sequence[str]) -> list[list[object]]:
    """Return a table row for each method: its name, then its median for each value of the key."""
    keys = list(dict.fromkeys(row[key] for row in rows))
    return [
        [name, *(_median(values(rows, value, method=name, **{key: at})) for at in keys)]
        for name in names
    ]


def _median(found: np.ndarray) -> object:
    return float(np.median(found)) if len(found) else "-"


def curves(axes: Axes, rows: list[Row], key: str, value: str) -> None:
    """Plot the median of each method over the key."""
    axes.set_prop_cycle(color=colormaps["tab20"].colors)  # there may be more than ten methods
    for name in dict.fromkeys(row["method"] for row in rows):
        keys = list(dict.fromkeys(row[key] for row in rows if row["method"] == name))
        heights = [np.median(values(rows, value, method=name, **{key: at})) for at in keys]
        axes.plot(keys, heights, "o-", label=name)
