"""Jobs whose right result is known, for services that are killed meanwhile."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.factories.scans import Points, Pose, arms, motion, moved, pose_error

BAD_EVERY = 10
"""Each tenth job has a source of two points and must fail for that."""
SLOW_EVERY, SLOW_POINTS = 4, 10_000
"""Each fourth job takes most of a second; the others a tenth of that."""
TARGET = arms(0)
SLOW_TARGET = arms(0, SLOW_POINTS)
ANGLE_DEG, SHIFT = 20, 0.2


@dataclass(frozen=True)
class Wanted:
    number: int
    source: Points
    target: Points
    truth: Pose

    @property
    def is_bad(self) -> bool:
        return self.number % BAD_EVERY == 0


def wanted(seed: int, number: int, *, some_slow: bool = False) -> Wanted:
    rng = np.random.default_rng((seed, number))
    target = SLOW_TARGET if some_slow and number % SLOW_EVERY == 1 else TARGET
    truth = motion(rng, target, ANGLE_DEG, SHIFT)
    source = moved(np.linalg.inv(truth), target)
    return Wanted(number, source[:2] if number % BAD_EVERY == 0 else source, target, truth)


def was_lost(job: dict[str, Any]) -> bool:
    return job["status"] == "failed" and job["error"]["type"] == "urn:mpe:problem:worker-lost"


def check_end(job: dict[str, Any], wanted: Wanted) -> None:
    """It is the right result, or a failure that the job is to blame for."""
    if was_lost(job):
        assert job["attempt"] >= 3
    elif wanted.is_bad:
        assert job["error"]["type"] == "urn:mpe:problem:too-few-points", job
    else:
        assert job["status"] == "succeeded", job
        found = np.array(job["result"]["transform"])
        degrees, shift = pose_error(found, wanted.truth, wanted.target)
        assert degrees < 0.1
        assert shift < 0.02
