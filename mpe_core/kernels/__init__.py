"""Compiled loops over points.

Numba runs them on OpenMP threads unless NUMBA_THREADING_LAYER_PRIORITY says otherwise. Its default
choice, TBB, waits for its threads when the process ends: 0.6 s on an idle machine, up to a minute
on a busy one.
"""

from __future__ import annotations

import os

import numba

if "NUMBA_THREADING_LAYER_PRIORITY" not in os.environ:
    numba.config.THREADING_LAYER_PRIORITY = ["omp", "tbb", "workqueue"]
