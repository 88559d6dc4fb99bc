"""A fixed part of the real pairs: recall must not fall, nor time grow against a yardstick."""

from __future__ import annotations

import json
import time

import numba
import numpy as np
import pytest
from scipy.spatial import KDTree

from mpe_core import register
from tests.factories.checks import pose_error
from tests.factories.clouds import real_pair

PAIRS = (
    "bunny_bun090_bun000",
    "bunny_bun270_bun180",
    "dragon_48_24",
    "dragon_120_96",
    "dragon_288_264",
    "uwa_chef_3_1",
    "kitti10m_010",
    "eth_tls_facade_6_5",
    "nclt_10_9",
    "bunnyreal_5_0",
    "fgr_01_11",
    "fricp_demo",
    "hippo2_hippo1",
    "goicp_demo",
    "livingroom1_1_0",
)
RATIO = 10.2
"""Yardsticks of the median registration: 10.1 to 10.2 in three runs, one of them beside two other
processes that did nothing but compute."""


@pytest.fixture(scope="module")
def runs(data):
    """For each pair: whether it is right, and its time over that of the yardstick.

    On one thread, in processor time: who else is busy on the machine then matters little.
    """
    pairs = {pair["id"]: pair for pair in json.loads((data / "pairs.json").read_text())}
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    found = []
    for name in PAIRS:
        trial = real_pair(data, name)
        before = yardstick(trial.target)
        start = time.process_time()
        T = register(trial.source, trial.target).T_target_source
        seconds = time.process_time() - start
        after = yardstick(trial.target)
        degrees, shift = pose_error(T, trial.T_target_source, trial.source)
        pair = pairs[name]
        right = degrees < pair["max_rotation_deg"] and shift < pair["max_translation"]
        found.append((right, seconds / min(before, after)))
    numba.set_num_threads(threads)

    return found


def yardstick(cloud):
    """Seconds to build a k-d tree of the cloud and ask it for each point of the cloud."""
    start = time.process_time()
    KDTree(cloud).query(cloud)
    return time.process_time() - start


def test_recall_does_not_fall(runs):
    # all were right when this was written
    assert all(right for right, _ in runs)


def test_time_does_not_grow(runs):
    ratio = np.median([ratio for _, ratio in runs])
    print(f"median of the registrations: {ratio:.1f} yardsticks")
    assert ratio < 2 * RATIO
