"""How long /livez of a service takes, beside a server that does nothing."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np

from tests.factories.server import free_port
from tests.factories.waiting import until


class Call(NamedTuple):
    """One call of a probe."""

    began_at: float
    """By `time.time`."""
    took_s: float
    is_answered: bool
    """Whether the answer was 200."""


Calls = list[Call]


@contextmanager
def measured(port: int) -> Iterator[tuple[Calls, Calls]]:
    """Calls of /livez at the port, and of a bare server, which runs meanwhile; they grow."""
    bare_port = free_port()
    bare = _run("tests.e2e.bare_server", bare_port)
    probe = _run("tests.e2e.probe", port, bare_port)
    calls: dict[int, Calls] = {port: [], bare_port: []}
    reader = threading.Thread(target=_read_calls, args=(probe, calls))
    reader.start()
    try:
        until(lambda: all(calls.values()))  # the probe has started
        for begun in calls.values():
            begun.clear()
        yield calls[port], calls[bare_port]
    finally:
        assert probe.stdin is not None
        probe.stdin.close()
        reader.join()
        probe.wait()
        bare.kill()
        bare.communicate()


def percentiles_ms(calls: Calls) -> tuple[float, float]:
    """Median and 99th percentile of the times, in milliseconds; one without an answer counts."""
    times = [call.took_s for call in calls] or [np.nan]
    p50, p99 = (round(1000 * float(s), 1) for s in np.percentile(times, (50, 99)))
    return p50, p99


def _run(module: str, *ports: int) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", module, *map(str, ports)]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def _read_calls(probe: subprocess.Popen[str], calls: dict[int, Calls]) -> None:
    assert probe.stdout is not None
    with probe.stdout as lines:
        for line in lines:
            port, began_at, took_s, is_answered = line.split()
            call = Call(float(began_at), float(took_s), is_answered == "1")
            calls[int(port)].append(call)
