"""Progress of a registration by stage, and the time that each stage took."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

StageCallback = Callable[[str, float], None]
"""Takes the stage, and the fraction of the whole in [0, 1]."""

FractionCallback = Callable[[float], None]
"""Takes the fraction of a stage in [0, 1]."""

STAGE_SHARES = {"prepare": 0.2, "search": 0.4, "refine": 0.3, "inliers": 0.1}
"""Share of the whole that each stage counts for, in order."""


@contextmanager
def timed(timing: dict[str, float], name: str) -> Iterator[None]:
    """Add the seconds that the context takes to `timing[name]`."""
    start = time.perf_counter()
    try:
        yield
    finally:
        timing[name] = timing.get(name, 0.0) + time.perf_counter() - start


class Progress:
    """Progress reports to a callback, and seconds by stage.

    The reported fraction never goes back, even where a stage is entered again. An exception that
    the callback raises ends the registration.
    """

    def __init__(self, on_progress: StageCallback | None) -> None:
        """Start the clock."""
        self._callback = on_progress or (lambda stage, fraction: None)
        self._start = time.perf_counter()
        self._done = 0.0
        self.timing: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[FractionCallback]:
        """Time a stage; yields a function that reports the fraction of the stage."""
        names = list(STAGE_SHARES)
        base = sum(STAGE_SHARES[earlier] for earlier in names[: names.index(name)])
        with timed(self.timing, name):
            self._report(name, base)
            yield lambda fraction: self._report(name, base + STAGE_SHARES[name] * fraction)

    def finish(self) -> dict[str, float]:
        """Report the end, and return the seconds by stage and in total."""
        self._report("inliers", 1.0)
        return self.timing | {"total": time.perf_counter() - self._start}

    def _report(self, name: str, fraction: float) -> None:
        self._done = max(self._done, fraction)
        self._callback(name, self._done)
