"""Compiled loops over points.

Numba runs them on the threads of OpenMP where it may choose. TBB, which it prefers where a system
has it, ends a process by waiting for its threads: up to a minute on a busy machine, 0.6 s on an
idle one.
"""

from __future__ import annotations

import os

import numba

if "NUMBA_THREADING_LAYER_PRIORITY" not in os.environ:
    numba.config.THREADING_LAYER_PRIORITY = ["omp", "tbb", "workqueue"]
