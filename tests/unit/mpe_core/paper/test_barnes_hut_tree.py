"""The sum over the cells of a tree against its exact twin."""

import time

import numba
import numpy as np
import pytest

from mpe_core import InvalidOptionsError, RegistrationOptions, register
from mpe_core.kernels.tree_sum import GROUP
from mpe_core.paper.barnes_hut_tree import build_tree, tree_order
from mpe_core.paper.force_field import ExactField, TreeField
from tests.factories.checks import pose_error
from tests.factories.clouds import bunny, knot, moved, real_pair


def off(force, exact):
    """Root mean square of the error, over that of the forces."""
    return np.sqrt(((force - exact) ** 2).sum() / (exact**2).sum())


@pytest.mark.parametrize("counts", [(1, 1), (5, 3), (33, 32), (300, 33), (100, 4000), (50, 50_000)])
@pytest.mark.parametrize("eps", [0.01, 0.3])
def test_force_is_the_double_sum(counts, eps):
    rng = np.random.default_rng(counts)
    x, y = knot(counts[0], rng) + 0.1, knot(counts[1], rng)
    # a third-order term of the series: (radius / distance)^3 = 0.008, with signs that cancel
    assert off(TreeField(y, eps).force(x), ExactField(y, eps).force(x)) < 2e-4
    weights = rng.lognormal(0, 2, counts[1])  # a few weigh most
    exact = ExactField(y, eps, weights).force(x)
    assert off(TreeField(y, eps, weights).force(x), exact) < 2e-4
    assert off(TreeField(y, eps).force(x), exact) > 0.01 or counts[1] == 1


def test_without_cells_afar_it_is_the_exact_sum(monkeypatch):
    monkeypatch.setattr("mpe_core.paper.force_field.OPENING_RATIO", np.float32(0))
    rng = np.random.default_rng(1)
    x, y = knot(500, rng) + 0.1, knot(3000, rng)
    assert off(TreeField(y, 0.05).force(x), ExactField(y, 0.05).force(x)) < 1e-6


def test_the_second_moments_earn_their_place(monkeypatch):
    rng = np.random.default_rng(2)
    x, y = knot(200, rng) + 0.1, knot(20_000, rng)
    exact, field = ExactField(y, 0.05).force(x), TreeField(y, 0.05)
    with_them = off(field.force(x), exact)
    field._tree[3][:, 4:10] = 0
    assert off(field.force(x), exact) > 10 * with_them


@pytest.mark.parametrize(
    "cloud",
    [
        np.ones((300, 3)),
        np.repeat(np.eye(3), 100, axis=0),
        np.vstack([knot(500, np.random.default_rng(3)), [[1e12, 0, 0]], np.full((40, 3), -1e5)]),
    ],
    ids=["one place", "three places", "stray points far away"],
)
def test_coincident_and_far_points_do_no_harm(cloud):
    x = knot(100, np.random.default_rng(4))
    for points in (x, cloud[:100]):
        np.testing.assert_allclose(
            TreeField(cloud, 0.05).force(points),
            ExactField(cloud, 0.05).force(points),
            atol=2e-4 * len(cloud) / 0.05**2 / 100,
        )


def test_every_order_of_the_points_has_the_same_forces():
    rng = np.random.default_rng(5)
    x, y = knot(2000, rng) + 0.05, knot(5000, rng)
    mixed, field = rng.permutation(len(x)), TreeField(y, 0.05)
    near = tree_order(x)
    forces = np.empty_like(x), np.empty_like(x)
    forces[0][mixed], forces[1][near] = field.force(x[mixed]), field.force(x[near])
    assert off(*forces) < 4e-4


def test_the_bits_do_not_depend_on_the_threads():
    rng = np.random.default_rng(7)
    field, x = TreeField(knot(5000, rng), 0.05), knot(3000, rng)
    before = numba.get_num_threads()
    results = []
    for threads in {1, before}:
        numba.set_num_threads(threads)
        results.append(field.force(x).tobytes())
    numba.set_num_threads(before)
    assert len(set(results)) == 1


@pytest.mark.parametrize("count", [1, 32, 33, 1000])
def test_cells_are_what_they_stand_for(count):
    rng = np.random.default_rng(8)
    cloud, weights = knot(count, rng), rng.lognormal(0, 2, count)
    tree = build_tree(cloud, weights)
    leaves = len(tree.starts) - 1
    assert np.diff(tree.starts).max() <= GROUP
    assert len(tree.cells) == 2 * leaves - 1
    kept = np.vstack([tree.points, tree.weights]).T
    rows = np.column_stack([cloud, weights]).astype(np.float32)
    np.testing.assert_array_equal(sorted(kept.tolist()), sorted(rows.tolist()))
    for cell, start, end in (
        (0, 0, count),
        *((leaves - 1 + k, tree.starts[k], tree.starts[k + 1]) for k in range(leaves)),
    ):
        points, mass = (
            rows[..., start:end].astype(np.float64) for rows in (tree.points, tree.weights)
        )
        centre = np.average(points, axis=1, weights=mass)
        arm = points - centre[:, None]
        np.testing.assert_allclose(tree.cells[cell, :3], centre, atol=1e-6)
        assert tree.cells[cell, 3] == pytest.approx(mass.sum(), rel=1e-6)
        expected = ((mass * arm) @ arm.T)[np.triu_indices(3)]
        np.testing.assert_allclose(tree.cells[cell, 4:10], expected, atol=1e-6 * mass.sum())
        assert tree.cells[cell, 10] == pytest.approx(
            np.linalg.norm(arm, axis=0).max(), abs=2e-5, rel=1e-5
        )


def test_the_whole_bunny_ends_where_the_exact_sum_does_in_less_time(data):
    trial = moved(bunny(data, "bun_zipper"), np.random.default_rng(2))
    found, seconds = {}, {}
    for field in ("exact", "tree"):
        start = time.process_time()  # of all threads; what others do does not count
        found[field] = register(
            trial.source, trial.target, RegistrationOptions(method="mpe", field=field)
        )
        seconds[field] = time.process_time() - start
    _same_pose(found["tree"], found["exact"], trial)
    assert pose_error(found["tree"].T_target_source, trial.T_target_source, trial.source)[0] < 0.5
    assert seconds["tree"] < seconds["exact"] / 2  # measured: 4.7


def test_views_end_where_the_exact_sum_does(data):
    trial = real_pair(data, "dragon_120_96", largest_deg=60, seed=1)
    _same_pose(
        *(
            register(trial.source, trial.target, RegistrationOptions(method="mpe", field=field))
            for field in ("tree", "exact")
        ),
        trial,
    )


def _same_pose(tree, exact, trial):
    """Within 0.05 degrees and a thousandth of the radius, by another sum: not the same bits."""
    radius = np.linalg.norm(trial.source - trial.source.mean(axis=0), axis=1).max()
    degrees, shift = pose_error(tree.T_target_source, exact.T_target_source, trial.source)
    assert degrees < 0.05
    assert shift < 1e-3 * radius
    assert tree.T_target_source.tobytes() != exact.T_target_source.tobytes()
    assert pose_error(np.eye(4), exact.T_target_source, trial.source)[0] > 5


def test_an_unknown_field_is_refused():
    with pytest.raises(InvalidOptionsError, match="field must be one of"):
        RegistrationOptions(field="mesh")
