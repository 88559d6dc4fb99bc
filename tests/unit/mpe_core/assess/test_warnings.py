"""Warnings say what a caller should know, and nothing where all is well."""

from dataclasses import replace

import numpy as np
import pytest

from mpe_core import register
from mpe_core.assess.confidence import Evidence
from mpe_core.assess.warnings import describe_warnings
from mpe_core.clouds.normalize import normalize_pair
from mpe_core.clouds.validate import validate_cloud
from mpe_core.geometry.rigid import pose
from tests.factories.clouds import knot

GOOD, BAD = Evidence(1.0, 1.0, 1.0), Evidence(0.34, 0.1, 0.12)


@pytest.fixture(scope="module")
def cloud():
    return knot(3000, np.random.default_rng(0))


@pytest.fixture(scope="module")
def result(cloud):
    return register(cloud, cloud + 1)


def pair_of(source, target):
    return normalize_pair(validate_cloud(source), validate_cloud(target))


def test_a_good_result_has_no_warnings(cloud, result):
    assert result.warnings == ()
    assert describe_warnings(pair_of(cloud, cloud), GOOD, result) == ()


def test_each_trouble_has_its_sentence_in_order(cloud, result):
    holed = np.vstack([cloud, [[np.nan, 0, 0]]])
    none = replace(result.inliers, **{k: np.empty(0) for k in ("source", "target", "distance")})
    bad = replace(
        result,
        converged=False,
        iterations=30,
        ambiguous=True,
        alternatives=np.array([pose(np.eye(3), t) for t in np.eye(3)[:2]]) @ result.T_target_source,
        free_directions=np.eye(6)[3:4],
        inliers=none,
    )
    texts = describe_warnings(pair_of(holed, 1000 * cloud), BAD, bad)
    expected = (
        "1 rows of the source were ignored",
        "not converged after 30 iterations",
        "low confidence, do not trust this pose: 34% of the points",
        "2 other poses fit as well (see alternatives), for instance shifted by 1 along",
        "undetermined in 1 of 6 directions (see free_directions): the source slides along x",
        "no source point is within the inlier threshold",
    )
    assert len(texts) == len(expected)
    assert [text.code for text in texts] == [
        "rows_not_finite",
        "not_converged",
        "low_confidence",
        "ambiguous",
        "free_directions",
        "no_inliers",
    ]
    for text, start in zip(texts, expected, strict=True):
        assert start in text
