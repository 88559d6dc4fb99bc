"""Experiment 4, Table I: error and time of the sparse MPE against the sampling ratio."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from benchmarks.experiment import DATA, Experiment, Result, markdown, timed
from mpe_core.clouds.normalize import normalize_pair
from mpe_core.clouds.validate import validate_cloud
from mpe_core.geometry.rigid import apply
from mpe_core.paper.sparse_search import search_sparse
from tests.factories.clouds import bunny, moved

PAPER = {  # ratio: mean seconds, error
    0.05: (0.71, 0.010845),
    0.10: (2.89, 0.008355),
    0.15: (6.22, 0.004785),
    0.20: (11.3, 0.007065),
    0.25: (18.5, 0.005311),
    0.30: (25.4, 0.004270),
    0.40: (47.3, 0.002728),
    0.50: (255.0, 0.002947),
    0.60: (115.0, 0.002449),
    0.70: (149.0, 0.001974),
    0.80: (195.0, 0.002077),
}
TRIALS = 10


def run() -> Result:
    """Measure, and return the figures that the page shows."""
    cloud, rows = bunny(DATA), []
    for ratio in PAPER:
        for seed in range(TRIALS):
            trial = moved(cloud, np.random.default_rng(seed))
            pair = normalize_pair(validate_cloud(trial.source), validate_cloud(trial.target))
            found, seconds = timed(
                search_sparse,
                pair.source,
                pair.target,
                round(ratio * len(cloud)),
                100,
                seed,
                lambda fraction: None,
            )
            T = pair.to_caller(found.T)
            gap = apply(T, trial.source) - apply(trial.T_target_source, trial.source)
            rows.append(
                {
                    "ratio": ratio,
                    "seconds": seconds,
                    "error": float(np.sqrt(np.mean((gap**2).sum(axis=1)))),
                }
            )
    return {"rows": rows}


def table(result: Result) -> str:
    """Return the page's text and tables in Markdown."""
    rows = []
    for ratio, (seconds, error) in PAPER.items():
        mine = [r for r in result["rows"] if r["ratio"] == ratio]
        times, errors = ([r[key] for r in mine] for key in ("seconds", "error"))
        rows.append(
            (
                ratio,
                float(np.mean(times)),
                seconds,
                float(np.median(errors)),
                f"{np.std(errors):.2g}",
                sum(e > 0.3 for e in errors),
                error,
            )
        )
    columns = (
        "ratio",
        "seconds",
        "paper",
        "error",
        "deviation",
        f"lost of {TRIALS}",
        "paper's error",
    )
    return (
        "Bunny of 1,889 points, radius 1, turned by up to 90 degrees. Algorithm 1 on a random part "
        "of each cloud, without refinement; error is the root mean square distance of the source "
        "points from their true places (the paper does not say how its own is scaled); lost: "
        "above 0.3.\n\n" + markdown(columns, rows)
    )


def draw(result: Result, figure: Figure) -> None:
    """Draw the page's picture."""
    axes = figure.subplots()
    axes.plot(
        [r["seconds"] for r in result["rows"]], [r["error"] for r in result["rows"]], "v", alpha=0.5
    )
    for ratio in PAPER:
        mine = [r for r in result["rows"] if r["ratio"] == ratio]
        x, y = (float(np.median([r[key] for r in mine])) for key in ("seconds", "error"))
        axes.annotate(f"{ratio:g}", (x, y), fontsize=12)
    axes.set(xlabel="seconds", ylabel="error", xscale="log", yscale="log")


SAMPLING = Experiment("paper_sampling", "Table I: sampling ratio", run, table, draw)
