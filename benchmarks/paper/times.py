"""Table II: time of MPE and MPL against the number of points."""

from __future__ import annotations

import numpy as np

from benchmarks.experiment import DATA, Experiment, Result, markdown, timed
from mpe_core import RegistrationOptions, register
from tests.factories.checks import pose_error
from tests.factories.clouds import bunny, moved

CLOUDS = ("bun_zipper_res4", "bun_zipper_res3", "bun_zipper_res2", "bun_zipper")
TRIALS = 3
METHODS = {
    "MPE": RegistrationOptions(method="mpe", field="exact"),
    "MPE, tree": RegistrationOptions(method="mpe"),
    "MPL (200)": RegistrationOptions(search="sparse", sample_size=200),
    "MPL (100)": RegistrationOptions(search="sparse", sample_size=100),
    "MPL, global search": RegistrationOptions(),
}
PAPER = {  # seconds, Intel i5 at 3.4 GHz
    453: {"MPE": 16.4, "MPL (200)": 3.3, "MPL (100)": 0.9},
    1889: {"MPE": 5.1 * 60, "MPL (200)": 3.9, "MPL (100)": 1.5},
    8171: {"MPE": 1.6 * 3600, "MPL (200)": 7.2, "MPL (100)": 4.8},
    35947: {"MPE": 30.6 * 3600, "MPL (200)": 20.2, "MPL (100)": 18.4},
}


def run() -> Result:
    """Measure, and return the figures that the page shows."""
    rows = []
    for name in CLOUDS:
        cloud = bunny(DATA, name)
        for method, options in METHODS.items():
            seconds, degrees = [], []
            for seed in range(TRIALS):
                trial = moved(cloud, np.random.default_rng(seed))
                found, took = timed(register, trial.source, trial.target, options)
                seconds.append(took)
                degrees.append(
                    pose_error(found.T_target_source, trial.T_target_source, trial.source)[0]
                )
            rows.append(
                {"points": len(cloud), "method": method, "seconds": seconds, "degrees": degrees}
            )
    return {"rows": rows}


def table(result: Result) -> str:
    """Return the page's text and tables in Markdown."""
    rows = []
    for r in result["rows"]:
        ours, paper = float(np.median(r["seconds"])), PAPER[r["points"]].get(r["method"])
        right = sum(error < 2 for error in r["degrees"])
        times = paper / ours if paper else "-"
        rows.append((r["points"], r["method"], ours, paper or "-", times, f"{right}/{TRIALS}"))
    text = (
        f"The four bunnies, turned by up to 90 degrees and moved by up to half a diagonal; median "
        f"of {TRIALS} trials. MPE: the exact double sum; tree: distant parts of the target as one. "
        "MPL (n): as printed, with samples of n points; "
        "the global search finds every rotation, not those up to 90 degrees only.\n\n"
    )
    columns = ("points", "method", "seconds", "paper, seconds", "times faster", "within 2 degrees")
    return text + markdown(columns, rows)


TIMES = Experiment("paper_times", "Table II: time against size", run, table)
