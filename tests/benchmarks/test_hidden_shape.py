"""The model of the best pose where the shape is hidden is the one that was fitted."""

import json

import numpy as np
import pytest

pytest.importorskip("matplotlib")
from benchmarks.experiment import RESULTS
from benchmarks.hidden_shape import fit
from mpe_core.assess.confidence import BEST_OF_HIDDEN


def test_the_weights_in_use_are_the_fitted_ones():
    rows = json.loads((RESULTS / "hidden_shape.json").read_text())["result"]["rows"]
    np.testing.assert_allclose(fit(rows), BEST_OF_HIDDEN, atol=0.06)


def test_a_fit_finds_the_model_that_made_the_cases():
    rng = np.random.default_rng(0)
    rows = []
    for score, contrast in zip(rng.normal(0, 3, 20_000), rng.uniform(-1, 6, 20_000), strict=True):
        right = rng.random() < 1 / (1 + np.exp(2 - 0.5 * score - contrast))
        rows.append({"score": score, "contrast": contrast, "right": right})
    # a wrong one that counts twice moves the even odds to 1 : 2
    assert fit(rows) == pytest.approx([0.5, 1.0, -2 - np.log(2)], abs=0.15)
