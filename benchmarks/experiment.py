"""An experiment: measured once, kept as JSON, shown as a table and a picture."""

from __future__ import annotations

import json
import os
import platform
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

RESULTS = Path(__file__).parent.parent / "docs" / "results"
DATA = Path(os.environ.get("MPE_DATA", Path(__file__).parent.parent.parent / "shared" / "data"))
PACKAGES = ("mpe", "numpy", "scipy", "numba", "open3d-cpu", "kiss-matcher", "small-gicp", "pycpd")

Result = dict[str, Any]


@dataclass(frozen=True)
class Experiment:
    name: str
    title: str
    run: Callable[[], Result]
    table: Callable[[Result], str]
    """The result in Markdown, with a sentence on what was done and what it is compared with."""
    draw: Callable[[Result, Figure], None] | None = None


def main(experiments: Sequence[Experiment], command: str) -> None:
    """Run the experiments named on the command line, or all of them, and write the results."""
    known = {experiment.name: experiment for experiment in experiments}
    names = sys.argv[1:] or list(known)
    if unknown := [name for name in names if name not in known]:
        sys.exit(f"unknown: {', '.join(unknown)}; there are: {', '.join(known)}")
    for name in names:
        start = time.perf_counter()
        result = known[name].run()
        seconds = round(time.perf_counter() - start, 1)
        _save(known[name], f"{command} {name}", seconds, result)
        print(f"\n## {known[name].title} ({seconds} s)\n\n{known[name].table(result)}")


def _save(experiment: Experiment, command: str, seconds: float, result: Result) -> None:
    RESULTS.mkdir(parents=True, exist_ok=True)
    kept = {"command": command, "seconds": seconds, "environment": environment(), "result": result}
    text = json.dumps(kept, indent=1, default=float)
    (RESULTS / f"{experiment.name}.json").write_text(text + "\n")
    picture = ""
    if experiment.draw:
        mpl.use("Agg")
        figure = Figure(figsize=(8, 5), layout="constrained")
        experiment.draw(result, figure)
        figure.savefig(RESULTS / f"{experiment.name}.png", dpi=110)
        picture = f"\n\n![{experiment.title}]({experiment.name}.png)"
    page = (
        f"# {experiment.title}\n\n{experiment.table(result)}{picture}\n\n"
        f"`{command}`, {seconds} s; {described(kept['environment'])}.\n"
    )
    (RESULTS / f"{experiment.name}.md").write_text(page)


def environment() -> dict[str, str | int]:
    """What the figures depend on besides the code."""
    return {
        "cores": os.cpu_count() or 1,
        "architecture": platform.machine(),
        "python": platform.python_version(),
    } | {package: version(package) for package in PACKAGES}


def described(environment: dict[str, Any]) -> str:
    return ", ".join(f"{key} {value}" for key, value in environment.items())


def markdown(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A Markdown table; floats with three significant digits."""
    lines = ["| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
    lines += ["| " + " | ".join(_cell(value) for value in row) + " |" for row in rows]
    return "\n".join(lines)


def _cell(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.0f}" if abs(value) >= 1000 else f"{value:.3g}"
    return str(value)


def timed(call: Callable[..., Any], *arguments: object) -> tuple[Any, float]:
    """What the call returns, and its seconds."""
    start = time.perf_counter()
    value = call(*arguments)
    return value, time.perf_counter() - start
