"""Measurements: the paper's experiments, the peers, the speed. Results go to docs/results."""

import os

os.environ["NUMBA_THREADING_LAYER"] = "omp"  # whatever else is installed: figures stay comparable
