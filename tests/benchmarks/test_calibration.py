"""The weights where noise hides the shape are those that were fitted."""

import json

import numpy as np
import pytest

pytest.importorskip("matplotlib")
from benchmarks.calibration import fit
from benchmarks.experiment import RESULTS
from mpe_core.assess.confidence import NOISY_MODEL


def test_the_weights_in_use_are_the_fitted_ones():
    rows = json.loads((RESULTS / "calibration.json").read_text())["result"]["rows"]
    in_use = (NOISY_MODEL.agreement, NOISY_MODEL.coverage, NOISY_MODEL.intercept)
    np.testing.assert_allclose(fit([r for r in rows if r["half"] == 0]), in_use, atol=0.06)


def test_a_fit_finds_the_model_that_made_the_cases():
    rng = np.random.default_rng(0)
    rows = []
    for agreement, coverage in rng.uniform(0, 1, (20_000, 2)):
        # a wrong one that counts twice moves the even odds to 1 : 2
        logit = 8 * agreement + 3 * coverage - 6
        right = rng.random() < 1 / (1 + np.exp(-logit))
        rows.append({"surface_agreement": agreement, "coverage": coverage, "right": right})
    agreement, coverage, intercept = fit(rows)
    assert agreement == pytest.approx(8, abs=0.5)
    assert coverage == pytest.approx(3, abs=0.5)
    assert intercept == pytest.approx(-6 - np.log(2), abs=0.5)
