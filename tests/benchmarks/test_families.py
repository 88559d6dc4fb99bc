"""The models of the confidence are those that were fitted over families."""

import json

import numpy as np
import pytest

pytest.importorskip("matplotlib")
from benchmarks.experiment import RESULTS
from benchmarks.families import Poses, fit, left_out, poses_of
from mpe_core.assess.confidence import MODEL, SEEN_MODEL


@pytest.mark.parametrize(("model", "seen"), [(MODEL, False), (SEEN_MODEL, True)])
def test_the_models_in_use_are_the_fitted_ones(model, seen):
    rows = json.loads((RESULTS / "families.json").read_text())["result"]["rows"]
    fitted = fit(poses_of(rows, seen=seen))
    score = (
        model.agreement,
        model.small_coverage,
        model.shape,
        -model.violation,
        -model.layers,
        model.intercept,
    )
    np.testing.assert_allclose(fitted.score, score, atol=0.06)
    np.testing.assert_allclose(fitted.best, model.best, atol=0.06)


def made_up(family, rng, *, is_told):
    """A case of four poses; the right one has more shape, if anything tells it."""
    X = np.zeros((4, 5))
    X[:, 0] = rng.uniform(0.4, 1, 4)
    X[:, 2] = rng.uniform(-0.2, 0.3, 4)
    if is_told:
        X[0, 2] = rng.uniform(0.6, 1)
    right = np.array([is_told, False, False, False])
    return Poses(family, is_told, X, X[:, 0], right, ~np.eye(4, dtype=bool))


def test_what_tells_right_from_wrong_in_other_families_tells_it_in_one_left_out():
    rng = np.random.default_rng(0)
    cases = [made_up(family, rng, is_told=k % 2 == 0) for family in "abcd" for k in range(20)]
    judged = left_out(cases)
    assert all(row["right"] for row in judged if row["possible"])
    assert all((row["odds"] > 0) == row["right"] for row in judged)


def test_a_family_says_nothing_of_itself():
    """Where only one family has right poses, and by the opposite sign, none of it is trusted."""
    rng = np.random.default_rng(1)
    cases = [made_up("a", rng, is_told=True) for _ in range(20)]
    for case in (made_up("b", rng, is_told=True) for _ in range(20)):
        case.X[:, 2] *= -1
        cases.append(case)
    wrong = [row for row in left_out(cases) if row["odds"] > 0 and not row["right"]]
    assert len(wrong) >= 20, "judged by the other family's model"
