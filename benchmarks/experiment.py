"""Experiments: measured once, stored as JSON, shown as a table and a picture."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numba
from matplotlib.figure import Figure

PROJECT = Path(__file__).parent.parent
RESULTS = PROJECT / "docs" / "results"
DATA = Path(os.environ.get("MPE_DATA", PROJECT.parent / "shared" / "data"))
INTRODUCTION = """# Results

Each page has its table, the command that made it, the time it took and the versions; the
raw figures are in the JSON file of the same name. `make bench` (the peers and the speed) and
`make paper` (the paper's experiments) make all that the code has changed since; stopped, they go on
where they were. The commands below make one page again. All need the real clouds (`MPE_DATA`), and
`make peers` installs what the lock file does not hold: PCL's driver and probreg. A load above 1
says that other programs took part of the time: such seconds compare within a page only.

Written by hand: [files far larger than the memory](large.md) (`python -m benchmarks.large`), and
[speed of decoding](decode.md) (`python -m benchmarks.decode`).
"""
PACKAGES = ("mpe", "numpy", "scipy", "numba", "open3d-cpu", "kiss-matcher", "small-gicp", "pycpd")

Result = dict[str, Any]


@dataclass(frozen=True)
class Experiment:
    """A measurement and how its page shows it."""

    name: str
    """Name on the command line and of the page's files."""
    title: str
    run: Callable[[], Result]
    table: Callable[[Result], str]
    """Returns the result in Markdown, with a sentence on what was done and how to compare it."""
    draw: Callable[[Result, Figure], None] | None = None


def main(experiments: Sequence[Experiment], command: str) -> None:
    """Run the experiments named on the command line, or all without a page from this code."""
    known = {experiment.name: experiment for experiment in experiments}
    if unknown := [name for name in sys.argv[1:] if name not in known]:
        sys.exit(f"unknown: {', '.join(unknown)}; there are: {', '.join(known)}")
    started = time.perf_counter()
    for name in sys.argv[1:] or _unfinished(known):
        print(f"{name} ...", flush=True)
        result, seconds = timed(known[name].run)
        _save(known[name], f"{command} {name}", round(seconds, 1), result)
        print(f"\n## {known[name].title} ({seconds:.0f} s)\n\n{known[name].table(result)}\n")
    print(f"{command}: {time.perf_counter() - started:.0f} s in all")


def _unfinished(names: Iterable[str]) -> Iterator[str]:
    for name in names:
        path = RESULTS / f"{name}.json"
        if path.is_file() and json.loads(path.read_text()).get("code") == code():
            print(f"{name}: there already, from this code")
        else:
            yield name


def code() -> str:
    """Return a fingerprint of what the figures depend on: core, benchmarks, locked versions."""
    digest = hashlib.sha256()
    for folder in ("mpe_core", "benchmarks"):
        for path in sorted((PROJECT / folder).rglob("*.py")):
            digest.update(path.read_bytes())
    digest.update((PROJECT / "requirements-dev.lock").read_bytes())
    return digest.hexdigest()[:16]


def _save(experiment: Experiment, command: str, seconds: float, result: Result) -> None:
    RESULTS.mkdir(parents=True, exist_ok=True)
    kept = {
        "title": experiment.title,
        "command": command,
        "seconds": seconds,
        "code": code(),
        "environment": environment(),
        "result": result,
    }
    (RESULTS / f"{experiment.name}.json").write_text(
        json.dumps(kept, indent=1, default=float) + "\n"
    )
    if experiment.draw:
        _draw(experiment, result)
    (RESULTS / f"{experiment.name}.md").write_text(_page(experiment, kept))
    _write_index()


def _draw(experiment: Experiment, result: Result) -> None:
    figure = Figure(figsize=(8, 5), layout="constrained")
    experiment.draw(result, figure)
    figure.savefig(RESULTS / f"{experiment.name}.png", dpi=110)


def _page(experiment: Experiment, kept: dict[str, Any]) -> str:
    picture = f"![{experiment.title}]({experiment.name}.png)\n\n" if experiment.draw else ""
    return (
        f"# {experiment.title}\n\n{experiment.table(kept['result'])}\n\n{picture}"
        f"`{kept['command']}`, {kept['seconds']} s; {described(kept['environment'])}.\n"
    )


def _write_index() -> None:
    """docs/results/README.md: every result there is, with its command and its picture."""
    lines = [INTRODUCTION]
    for path in sorted(RESULTS.glob("*.json")):
        kept = json.loads(path.read_text())
        lines.append(f"## [{kept['title']}]({path.stem}.md)\n\n`{kept['command']}`\n")
        if (RESULTS / f"{path.stem}.png").is_file():
            lines.append(f"![{kept['title']}]({path.stem}.png)\n")
    (RESULTS / "README.md").write_text("\n".join(lines))


def environment() -> dict[str, str | float]:
    """Return what the figures depend on besides the code."""
    return {
        "cores": os.cpu_count() or 1,
        "threads": numba.get_num_threads(),
        "load": round(os.getloadavg()[0], 1),  # more than one: others took part of the time
        "architecture": platform.machine(),
        "python": platform.python_version(),
    } | {package: version(package) for package in PACKAGES}


def described(environment: dict[str, Any]) -> str:
    """Return the environment as one line of text."""
    return ", ".join(f"{key} {value}" for key, value in environment.items())


def markdown(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a Markdown table; floats have three significant digits."""
    lines = ["| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
    lines += ["| " + " | ".join(_cell(value) for value in row) + " |" for row in rows]
    return "\n".join(lines)


def _cell(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.0f}" if abs(value) >= 1000 else f"{value:.3g}"
    return str(value)


def timed(call: Callable[..., Any], *arguments: object) -> tuple[Any, float]:
    """Call, and return the result and the seconds that it took."""
    start = time.perf_counter()
    value = call(*arguments)
    return value, time.perf_counter() - start
