"""How far to trust a pose of clouds of unlike sizes."""

import numpy as np
import pytest

from mpe_core import register
from mpe_core.confidence import LIKE_SIZES, Evidence
from tests.checks import assert_pose_close
from tests.clouds import real_pair


def test_chance_fits_on_a_much_larger_cloud_count_against_a_pose():
    def odds(larger):
        confidence = Evidence(near=0.9, on=0.6, sharp=0.6, larger=larger).confidence
        return confidence / (1 - confidence)

    assert odds(LIKE_SIZES) == pytest.approx(odds(1.0))
    assert odds(1.0) / odds(5 * LIKE_SIZES) == pytest.approx(25)


@pytest.mark.parametrize("name", ["dragon_24_0", "bunny_bun045_bun000"])
def test_a_small_part_of_a_scan_is_found_and_accepted(data, name):
    trial = real_pair(data, name)
    radius = np.quantile(np.linalg.norm(trial.target - trial.target.mean(axis=0), axis=1), 0.98)
    middle = trial.source[
        np.argmin(np.linalg.norm(trial.source - trial.source.mean(axis=0), axis=1))
    ]
    part = trial.source[np.linalg.norm(trial.source - middle, axis=1) < radius / 6]
    found = register(part, trial.target)
    assert found.accepted
    # a sixth of the length tells the rotation six times less exactly; the truth is good to 0.4
    assert_pose_close(
        found.T_target_source, trial.T_target_source, part, degrees=2.4, shift=0.02 * radius
    )
