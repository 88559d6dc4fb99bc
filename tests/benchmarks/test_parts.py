"""Parts that are cut from real scans."""

import numpy as np
import pytest

pytest.importorskip("matplotlib")
from benchmarks.parts import FRACTIONS, MIN_POINTS, PARTS, PARTS_OF_A_PAIR, parts
from mpe_core.clouds.normalize import robust_radius
from tests.factories.clouds import real_pair


def test_parts_are_as_small_as_said_and_lie_over_the_target(data):
    trial = real_pair(data, "dragon_24_0")
    whole = robust_radius(trial.target, trial.target.mean(axis=0))
    found = list(parts(trial))
    assert {fraction for fraction, _ in found} == set(FRACTIONS)
    assert len(found) == PARTS_OF_A_PAIR * len(FRACTIONS)
    for fraction, part in found:
        assert len(part) >= MIN_POINTS
        half_widths = np.ptp(part, axis=0) / 2
        assert 0.4 * whole / fraction < half_widths.max() <= whole / fraction


def row(**said):
    usual = {"fraction": 2, "right": True, "accepted": True, "ambiguous": False, "free": 0}
    return usual | {"seconds": 0.1} | said


def test_the_table_counts_what_passes_wrongly_and_what_is_refused():
    rows = [
        row(),
        row(accepted=False),
        row(right=False),
        row(right=False, free=1),
        row(right=False, ambiguous=True),
        row(right=False, accepted=False),
    ]
    rows += [row(fraction=fraction) for fraction in FRACTIONS[1:]]
    (line,) = [line for line in PARTS.table({"rows": rows}).split("\n") if "| 1/2 " in line]
    assert [cell.strip() for cell in line.split("|")[2:7]] == ["6", "2", "1", "3", "1"]
