"""The P2 energy."""

import numpy as np
import pytest

from mpe_core.assess.energy import p2_energy


def test_p2_energy_counts_close_points_fully_and_far_ones_not():
    assert p2_energy(np.zeros(5), 0.1) == -1
    assert p2_energy(np.full(5, 0.1), 0.1) == pytest.approx(-0.5)
    assert -1e-3 < p2_energy(np.full(5, 10.0), 0.1) < 0
    assert p2_energy(np.array([0.0, 10.0]), 0.1) == pytest.approx(-0.5, abs=1e-3)
