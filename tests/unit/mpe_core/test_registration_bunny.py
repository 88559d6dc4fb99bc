"""The bunny of 1,889 points, turned by up to 90 degrees and moved by up to half its diagonal.

`python -m benchmarks.paper paper_bunny` does the same from fifty starts.
"""

import numpy as np
import pytest

from mpe_core import register
from tests.factories.checks import pose_error
from tests.factories.clouds import bunny, moved

TRIALS = 8


@pytest.mark.parametrize(
    ("noise", "outliers", "degrees", "at_least"),
    [(0.0, 0, 0.1, 8), (0.02, 0, 2.0, 8), (0.0, 1500, 2.0, 7)],
)
def test_starts_from_any_rotation(data, noise, outliers, degrees, at_least):
    cloud, right, starts_right = bunny(data), 0, 0
    for seed in range(TRIALS):
        trial = moved(cloud, np.random.default_rng(seed), noise=noise, outliers=outliers)
        found = register(trial.source, trial.target)
        limits = np.array([degrees, np.radians(degrees)])
        truth, own = trial.T_target_source, trial.source[: len(cloud)]
        right += (pose_error(found.T_target_source, truth, own) < limits).all()
        starts_right += (pose_error(np.eye(4), truth, own) < limits).all()
    assert right >= at_least
    assert starts_right <= 1
