"""EM-ICP (Granger and Pennec 2002): soft matches whose width shrinks."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from benchmarks.methods.method import Array, Method
from mpe_core.rigid import apply, fit

NEIGHBOURS = 50  # matches of a point; those farther off weigh next to nothing
FIRST_WIDTH, LAST_WIDTH, SHRINK = 0.4, 0.01, 0.9  # in standard deviations of the target


def run(source: Array, target: Array) -> Array:
    unit, origin = float(target.std()), target.mean(axis=0)
    x, y = (source - source.mean(axis=0)) / unit, (target - origin) / unit
    tree, T, width = KDTree(y), np.eye(4), FIRST_WIDTH
    while width > LAST_WIDTH:
        distance, row = tree.query(apply(T, x), k=min(NEIGHBOURS, len(y)), workers=-1)
        # the nearest match alone keeps weight 1: no point is lost, however narrow the width
        weight = np.exp((distance[:, :1] ** 2 - distance**2) / (2 * width**2))
        weight /= weight.sum(axis=1, keepdims=True)
        T = fit(x, (weight[:, :, None] * y[row]).sum(axis=1))
        width *= SHRINK
    T[:3, 3] = unit * T[:3, 3] + origin - T[:3, :3] @ source.mean(axis=0)
    return T


EM_ICP = Method("EM-ICP", "scipy", run, "50 matches a point, width from 0.4 to 0.01 by 0.9")
