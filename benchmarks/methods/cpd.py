"""Coherent point drift (Myronenko and Song 2010)."""

from __future__ import annotations

import numpy as np
import pycpd

from benchmarks.methods.method import Array, Method, version_of

OUTLIERS = 0.1  # weight of the uniform part; the paper of CPD uses 0.1 to 0.7


def run(source: Array, target: Array) -> Array:
    """Return the pose T_target_source that the method finds."""
    origin, unit = target.mean(axis=0), float(target.std())
    drift = pycpd.RigidRegistration(
        X=(target - origin) / unit,
        Y=(source - source.mean(axis=0)) / unit,
        w=OUTLIERS,
        scale=False,
        max_iterations=100,
    )
    drift.register()
    T = np.eye(4)
    T[:3, :3] = drift.R.T  # pycpd multiplies rows from the right
    T[:3, 3] = unit * drift.t.ravel() + origin - T[:3, :3] @ source.mean(axis=0)
    return T


CPD = Method("CPD", version_of("pycpd"), run, "rigid, no scale, outlier weight 0.1, 100 iterations")
