"""Compiled loops over points.

Numba runs them on OpenMP threads unless NUMBA_THREADING_LAYER_PRIORITY says otherwise. Its default
choice, TBB, waits for its threads when the process ends: 0.6 s on an idle machine, up to a minute
on a busy one. There are no more threads than the cores that the control groups allow.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

from mpe_core.machine import available_cores

WAIT_TURNS = 1000
"""Turns of a waiting OpenMP thread before it sleeps, some 50 microseconds. GNU's 300,000 take the
cores from other processes, and from the thread that is waited for (docs/decisions)."""

if "OMP_WAIT_POLICY" not in os.environ:
    # GNU's OpenMP reads it when it is loaded, which the first kernel does
    os.environ.setdefault("GOMP_SPINCOUNT", str(WAIT_TURNS))
if available_cores() < (os.cpu_count() or 1):
    # read at the import of numba, and compared at each compilation, so that it has to stay
    os.environ.setdefault("NUMBA_NUM_THREADS", str(available_cores()))

import numba  # noqa: E402

if "NUMBA_THREADING_LAYER_PRIORITY" not in os.environ:
    numba.config.THREADING_LAYER_PRIORITY = ["omp", "tbb", "workqueue"]


@contextmanager
def on_usable_cores() -> Iterator[None]:
    """Use no more threads than there are cores now: limits may come after the import."""
    threads = numba.get_num_threads()
    numba.set_num_threads(min(threads, available_cores()))
    try:
        yield
    finally:
        numba.set_num_threads(threads)
