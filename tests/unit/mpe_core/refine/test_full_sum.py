"""The full-sum potential: its expansion by finite differences, its minimum by the truth."""

import numpy as np
import pytest

from mpe_core.geometry.rigid import axis_rotation, pose, rotation_error
from mpe_core.refine.full_sum import PotentialExpansion, minimize_full_sum
from tests.factories.clouds import bunny, knot, moved


def test_gradient_and_hessian_are_those_of_the_energy():
    rng = np.random.default_rng(2)
    x, y = knot(60, rng).astype(np.float32), knot(80, rng).T.astype(np.float32).copy()
    here = PotentialExpansion(
        x, y, pose(axis_rotation(np.array([1.0, 2, 3]), 0.2), np.full(3, 0.1)), 0.3
    )
    h = 0.02

    def energy(step):
        return PotentialExpansion(x, y, here.moved(step), 0.3).energy

    for k in range(6):
        e = h * np.eye(6)[k]
        slope = (energy(e) - energy(-e)) / (2 * h)
        bend = (energy(e) - 2 * here.energy + energy(-e)) / h**2
        assert -here.gradient[k] == pytest.approx(slope, rel=0.02, abs=0.02 * abs(here.energy) * h)
        assert here.hessian[k, k] == pytest.approx(bend, rel=0.05, abs=abs(here.energy) * h)


def test_it_beats_nothing_less_than_the_noise(data):
    cloud, noise = bunny(data), 0.04
    errors, start_errors = [], []
    for seed in range(8):
        trial = moved(cloud, np.random.default_rng(seed), largest_deg=0.001, noise=noise)
        rng = np.random.default_rng(100 + seed)
        off = pose(axis_rotation(rng.normal(size=3), np.radians(5)), 0.02 * rng.normal(size=3))
        start = off @ trial.T_target_source
        found = minimize_full_sum(
            trial.source.astype(np.float32),
            cloud.astype(np.float32),
            start,
            3 * noise,
            np.eye(6),
            50,
        )
        assert found.converged
        errors.append(rotation_error(found.T, trial.T_target_source))
        start_errors.append(rotation_error(start, trial.T_target_source))
    # a surface alone tells the rotation to 0.43 degrees at this noise (information of the normals)
    assert np.median(errors) < 1.0 < 4 < min(start_errors)
