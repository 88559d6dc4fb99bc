"""Every method of the comparisons registers a known case before it is compared."""

import numpy as np
import pytest

from tests.checks import assert_pose_close
from tests.clouds import bunny, moved, real_pair

pytest.importorskip("open3d")
methods = pytest.importorskip("benchmarks.methods", reason="peers are not installed")


@pytest.mark.parametrize("method", [*methods.LOCAL, methods.MPE], ids=lambda m: m.name)
def test_local_methods_undo_a_small_motion(data, method):
    trial = moved(bunny(data, "bun_zipper_res4"), np.random.default_rng(1), largest_deg=25)
    T = method.register(trial.source, trial.target)
    # LM-ICP reads distances from a lattice of 1 % of the diagonal
    assert_pose_close(T, trial.T_target_source, trial.source, degrees=0.5, shift=0.01)


@pytest.mark.parametrize("method", methods.GLOBAL[1:], ids=lambda m: m.name)
def test_global_methods_find_a_real_pair_from_any_rotation(data, method):
    trial = real_pair(data, "bunny_bun045_bun000")
    T = method.register(trial.source, trial.target)
    assert_pose_close(T, trial.T_target_source, trial.source, degrees=2, shift=0.005)
