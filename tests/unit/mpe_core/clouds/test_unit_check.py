"""Units are guessed from the sizes of two clouds."""

import pytest

from mpe_core.clouds.unit_check import METRES, guess_units


@pytest.mark.parametrize("source", METRES)
@pytest.mark.parametrize("target", METRES)
@pytest.mark.parametrize("size", [0.8, 1, 1.3])
def test_every_pair_of_units_is_guessed(source, target, size):
    factor = METRES[source] / METRES[target]
    factors = [guess.factor for guess in guess_units(2.0, 2.0 * size * factor)]
    assert source == target or any(each == pytest.approx(factor, rel=1e-3) for each in factors)


@pytest.mark.parametrize("ratio", [1, 0.7, 1.4, 5.7, 180])
def test_other_ratios_are_no_units(ratio):
    assert guess_units(2.0, 2.0 * ratio) == []
    assert guess_units(2.0 * ratio, 2.0) == []
