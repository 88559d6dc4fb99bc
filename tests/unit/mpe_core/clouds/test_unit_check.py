"""A unit mismatch is named as the likely cause; plain differences in size are not."""

from __future__ import annotations

import pytest

from mpe_core import register
from mpe_core.clouds.unit_check import describe_unit_mismatch
from tests.factories.clouds import real_pair


@pytest.mark.parametrize(
    ("factor", "words"),
    [(1000, "millimetres and metres"), (1 / 1000, "millimetres and metres"), (25.4, "inches")],
)
def test_a_real_pair_in_two_units_is_refused_with_the_reason(data, factor, words):
    trial = real_pair(data, "bunny_bun045_bun000")
    found = register(trial.source, factor * trial.target)
    assert not found.accepted
    (text,) = [text for text in found.warnings if "unit" in text]
    assert words in text
    assert ("the target is" in text) == (factor > 1)


def test_one_unit_raises_no_suspicion(data):
    trial = real_pair(data, "bunny_bun045_bun000")
    found = register(trial.source, trial.target)
    assert found.accepted
    assert not any("unit" in text for text in found.warnings)


@pytest.mark.parametrize("ratio", [1, 1.4, 5, 10, 3000])
def test_other_ratios_are_no_units(ratio):
    assert describe_unit_mismatch(2.0, 2.0 * ratio) is None
    assert describe_unit_mismatch(2.0 * ratio, 2.0) is None
