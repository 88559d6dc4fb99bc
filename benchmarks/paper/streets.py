"""Experiment 8: streets seen by LiDAR, high overlap and low."""

from __future__ import annotations

import json
from collections.abc import Iterator

import numpy as np
from matplotlib.figure import Figure

from benchmarks.comparison import Row, compare, described, settings_text, values
from benchmarks.experiment import DATA, Experiment, Result, markdown
from benchmarks.methods import GLOBAL, MPL, MPL_PAPER
from mpe_core.geometry.rigid import apply
from tests.factories.clouds import Trial, real_pair

SUITES = ("kitti10m", "nclt", "eth_tls_facade", "lidar_car", "lidar_small_gicp")
METHODS = [*GLOBAL, MPL_PAPER]
SHOWN = ("kitti10m_000", "eth_tls_facade_2_1")


def _pairs() -> Iterator[dict[str, object]]:
    for pair in json.loads((DATA / "pairs.json").read_text()):
        if pair["suite"] in SUITES:
            yield pair


def _trials() -> Iterator[tuple[Row, Trial]]:
    for pair in _pairs():
        labels = {"pair": pair["id"], "suite": pair["suite"], "overlap": pair["overlap"]}
        yield labels, real_pair(DATA, str(pair["id"]))


def run() -> Result:
    """Measure, and return the figures that the page shows."""
    limits = {pair["id"]: (pair["max_rotation_deg"], pair["max_translation"]) for pair in _pairs()}
    return {
        "rows": compare(METHODS, _trials()),
        "methods": described(METHODS),
        "limits": limits,
    }


def table(result: Result) -> str:
    """Return the page's text and tables in Markdown."""
    rows = []
    for suite in SUITES:
        line: list[object] = [suite]
        for name in result["methods"]:
            mine = [r for r in result["rows"] if (r["suite"], r["method"]) == (suite, name)]
            line.append(f"{sum(_right(r, result['limits']) for r in mine)}/{len(mine)}")
        rows.append(line)
    medians = [
        float(np.median(values(result["rows"], "seconds", method=m))) for m in result["methods"]
    ]
    return (
        "Street and facade pairs turned at random over SO(3), right by the tolerances of each "
        "pair. The paper shows pictures of four Sydney scenes, which are not public; these are the "
        "nearest at hand. MPL as printed is a local method: half of SO(3) is out of its reach.\n"
        f"{settings_text(result['methods'])}.\n\n"
        + markdown(("suite", *result["methods"]), [*rows, ["seconds, median", *medians]])
    )


def _right(row: Row, limits: dict[str, tuple[float, float]]) -> bool:
    degrees, shift = limits[row["pair"]]
    return bool(row["degrees"] <= degrees and row["shift"] <= shift)


def draw(result: Result, figure: Figure) -> None:
    """Before and after, seen from above."""
    for panels, name in zip(figure.subplots(2, 2), SHOWN, strict=True):
        trial = real_pair(DATA, name)
        after = apply(MPL.register(trial.source, trial.target), trial.source)
        sources = {"before": trial.source, "after": after}
        for axes, (when, source) in zip(panels, sources.items(), strict=True):
            for cloud, color in ((trial.target, "tab:red"), (source, "tab:blue")):
                axes.plot(*cloud[::5, :2].T, ",", color=color, alpha=0.5)
            axes.set(title=f"{name}, {when}", aspect="equal", xticks=[], yticks=[])


STREETS = Experiment("paper_streets", "Streets", run, table, draw)
