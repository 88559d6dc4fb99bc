"""Both orders of a pair get the same answer, where one of the clouds is clearly smaller."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mpe_core import Registration, RegistrationOptions, register
from mpe_core.geometry.rigid import apply, inverse
from tests.factories.clouds import Trial, real_pair


@pytest.fixture(scope="module")
def trial(data: Path) -> Trial:
    """Pair of which the source is 1.28 times as large as the target."""
    return real_pair(data, "nclt_1_0")


@pytest.fixture(scope="module")
def both_orders(trial: Trial) -> tuple[Registration, Registration]:
    return register(trial.source, trial.target), register(trial.target, trial.source)


def test_both_orders_get_the_same_pose_and_verdict(trial, both_orders) -> None:
    one, other = both_orders
    np.testing.assert_allclose(one.T_target_source, inverse(other.T_target_source), atol=1e-9)
    assert (one.confidence, one.accepted, one.ambiguous) == (
        other.confidence,
        True,
        other.ambiguous,
    )
    moved = apply(one.T_target_source, trial.source)
    assert np.linalg.norm(moved - apply(trial.T_target_source, trial.source), axis=1).max() < 0.6


def test_inliers_are_pairs_of_the_source_and_the_target(trial, both_orders) -> None:
    for found, source, target in (
        (both_orders[0], trial.source, trial.target),
        (both_orders[1], trial.target, trial.source),
    ):
        pairs = found.inliers
        gaps = apply(found.T_target_source, source[pairs.source]) - target[pairs.target]
        np.testing.assert_allclose(np.linalg.norm(gaps, axis=1), pairs.distance, atol=1e-6)
        assert found.overlap == len(pairs) / len(source)


def test_the_error_is_told_in_the_frame_of_either_target(both_orders) -> None:
    one, other = (each.covariance for each in both_orders)
    turns = [np.sqrt(np.linalg.eigvalsh(each[:3, :3])) for each in (one, other)]
    np.testing.assert_allclose(*turns, rtol=1e-6)


def test_what_the_caller_says_of_the_source_stays_true(trial, both_orders) -> None:
    near = register(
        trial.source,
        trial.target,
        RegistrationOptions(initial_transform=trial.T_target_source, overlap=0.9),
    )
    one, other = near.T_target_source, both_orders[0].T_target_source
    np.testing.assert_allclose(one[:3, :3], other[:3, :3], atol=2e-3)
