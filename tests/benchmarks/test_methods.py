"""Every method of the comparisons registers a known case before it is compared."""

import numpy as np
import pytest

from tests.factories.checks import assert_pose_close
from tests.factories.clouds import bunny, moved, real_pair

pytest.importorskip("open3d")
methods = pytest.importorskip("benchmarks.methods", reason="peers are not installed")
comparison = pytest.importorskip("benchmarks.comparison")

LOOSE = {methods.GMMREG: (3, 0.01)}  # it compares densities, not points


@pytest.fixture
def method(request):
    if not request.param.version:
        pytest.skip(f"{request.param.name} is not installed: make peers")
    return request.param


@pytest.mark.parametrize(
    "method", [*methods.LOCAL, methods.MPE], ids=lambda m: m.name, indirect=True
)
def test_local_methods_undo_a_small_motion(data, method):
    trial = moved(bunny(data, "bun_zipper_res4"), np.random.default_rng(1), largest_deg=25)
    T = method.register(trial.source, trial.target)
    # LM-ICP reads distances from a lattice of 1 % of the diagonal
    degrees, shift = LOOSE.get(method, (0.5, 0.01))
    assert_pose_close(T, trial.T_target_source, trial.source, degrees=degrees, shift=shift)


@pytest.mark.parametrize(
    "method",
    [*methods.GLOBAL[1:], *methods.AS_DOCUMENTED, methods.SAC_IA, methods.ROPS_GICP],
    ids=lambda m: m.name,
    indirect=True,
)
def test_global_methods_find_a_real_pair_from_any_rotation(data, method):
    trial = real_pair(data, "bunny_bun045_bun000")
    T = method.register(trial.source, trial.target)
    assert_pose_close(T, trial.T_target_source, trial.source, degrees=2, shift=0.005)


@pytest.mark.parametrize("method", [methods.ROPS], ids=lambda m: m.name, indirect=True)
def test_coarse_methods_come_near(data, method):
    trial = real_pair(data, "bunny_bun045_bun000")
    T = method.register(trial.source, trial.target)
    assert_pose_close(T, trial.T_target_source, trial.source, degrees=10, shift=0.02)


def test_a_method_that_is_not_installed_has_no_figures_and_is_named(capsys):
    def never(source, target):
        raise AssertionError("it is not installed")

    here = methods.Method("here", "here 1.0", lambda source, target: np.eye(4), "as it is")
    gone = methods.Method("gone", None, never, "as it was")
    trial = moved(np.random.default_rng(0).normal(size=(50, 3)), np.random.default_rng(1))
    rows = comparison.compare([here, gone], [({"seed": 0}, trial)])
    assert "gone IS NOT INSTALLED" in capsys.readouterr().err
    result = {"rows": rows, "methods": comparison.described([here, gone])}
    assert comparison.measured(result) == ["here"]
    assert comparison.absent(result, 3) == [("gone", "not installed", "not installed")]
