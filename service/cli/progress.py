"""Progress of a registration: a bar on a terminal, a line for each stage elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

OnStage = Callable[[str, float], None]
"""Called with a stage and the share of the whole that is done, in [0, 1]."""


@contextmanager
def show_progress() -> Iterator[OnStage]:
    """Show on stderr what the yielded callback is told."""
    bar = _open_bar() if sys.stderr.isatty() else None
    if bar is None:
        yield _print_stages()
        return
    with bar:
        task = bar.add_task("queued", total=1.0)
        yield lambda stage, fraction: bar.update(task, description=stage, completed=fraction)


def _open_bar() -> Any:
    """Return a bar of rich; None where it is not installed."""
    try:
        from rich.console import Console
        from rich.progress import Progress
    except ModuleNotFoundError:
        return None
    return Progress(console=Console(stderr=True), transient=True)


def _print_stages() -> OnStage:
    """Return a callback that prints each stage once."""
    seen: set[str] = set()

    def print_stage(stage: str, fraction: float) -> None:
        if stage not in seen:
            seen.add(stage)
            print(f"mpe: {stage} ({fraction:.0%})", file=sys.stderr, flush=True)

    return print_stage
