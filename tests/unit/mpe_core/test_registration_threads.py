"""Which threads the compiled loops run on."""

import os
import subprocess
import sys

import numba
import numpy as np
import pytest

from mpe_core import register

REPORT = """
import numpy as np, numba
from mpe_core import register
cloud = np.random.default_rng(0).normal(size=(200, 3))
register(cloud, cloud)
print(numba.threading_layer())
"""


@pytest.mark.parametrize(
    ("chosen", "layer"),
    [
        ({}, "omp"),
        ({"NUMBA_THREADING_LAYER_PRIORITY": "workqueue omp tbb"}, "workqueue"),
        ({"NUMBA_THREADING_LAYER": "workqueue"}, "workqueue"),
    ],
)
def test_it_is_openmp_unless_the_caller_says_otherwise(chosen, layer):
    inherited = {key: value for key, value in os.environ.items() if "THREADING" not in key}
    ran = subprocess.run(
        [sys.executable, "-c", REPORT],
        env=inherited | chosen,
        capture_output=True,
        text=True,
        check=True,
    )
    assert ran.stdout.split() == [layer]


SPIN_COUNT = """
import os
from mpe_core import register
print(os.environ.get("GOMP_SPINCOUNT"))
"""


@pytest.mark.parametrize(
    ("chosen", "turns"),
    [({}, "1000"), ({"GOMP_SPINCOUNT": "7"}, "7"), ({"OMP_WAIT_POLICY": "active"}, "None")],
)
def test_threads_sleep_while_they_wait_unless_the_caller_says_otherwise(chosen, turns):
    inherited = {
        key: value for key, value in os.environ.items() if not key.startswith(("OMP_", "GOMP_"))
    }
    ran = subprocess.run(
        [sys.executable, "-c", SPIN_COUNT],
        env=inherited | chosen,
        capture_output=True,
        text=True,
        check=True,
    )
    assert ran.stdout.split() == [turns]


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="no affinity on this system")
def test_a_limit_that_came_after_the_import_counts():
    """Two threads on one core wait for each other."""
    cloud = np.random.default_rng(0).normal(size=(200, 3))
    before, cores, used = numba.get_num_threads(), os.sched_getaffinity(0), set()
    try:
        os.sched_setaffinity(0, {min(cores)})
        register(cloud, cloud, on_progress=lambda *_: used.add(numba.get_num_threads()))
    finally:
        os.sched_setaffinity(0, cores)
    assert used == {1}
    assert numba.get_num_threads() == before
