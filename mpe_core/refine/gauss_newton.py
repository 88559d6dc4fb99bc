"""Descent of poses on the robust point-to-plane sum."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpe_core.clouds.preprocess import Sample
from mpe_core.kernels.plane_descent import find_nearest, step_on_planes, sum_gradients
from mpe_core.refine.minimum import STEP_TOL, Criterion, Minimum
from mpe_core.refine.target_planes import TargetPlanes

Array = NDArray[np.float64]

FIRST_CUTOFF_FACTOR = 3.0
"""Cut-off of the first steps, which bring the pose near, over that of the last ones."""

FIRST_STEP_TOL_FACTOR = 20.0
"""Step that ends the first steps over the one that ends the last ones."""


def minimize_point_to_plane(
    sample: Sample,
    target: TargetPlanes,
    poses: Array,
    motion_basis: Array,
    max_steps: int,
    *,
    smooth: bool = False,
    is_near: bool = False,
) -> list[Minimum]:
    """Minimise sum_i rho(n_i*.(y_i* - (R x_i + t))) from each of the poses by Gauss-Newton steps.

    y_i* is the nearest point of the target, n_i* the normal there and rho Tukey's biweight (Chen
    and Medioni 1991; robust loss after Babin et al. 2019).

    Parameters
    ----------
    sample
        Points x_i of the moving cloud.
    target
        Planes of the fixed cloud.
    poses
        (K, 4, 4) starts.
    motion_basis
        (6, M) basis of the small motions that are allowed.
    max_steps
        Bound on the steps of each pose.
    smooth
        Whether the planes are taken as fitted; otherwise each is moved to its point.
    is_near
        Whether the starts are near the minima; otherwise the first steps have a wider cut-off.
    """
    ends = np.array(poses, np.float64, order="C")
    cutoffs = np.array([FIRST_CUTOFF_FACTOR * target.cutoff, target.cutoff], np.float32)
    tolerances = np.array([FIRST_STEP_TOL_FACTOR * STEP_TOL, STEP_TOL])
    cutoffs, tolerances = cutoffs[is_near:], tolerances[is_near:]
    allowed = motion_basis @ np.linalg.pinv(motion_basis)
    nearest, anchors = _nothing_found(len(ends), sample)
    moving = _moving(sample)
    steps, rounds = np.zeros((2, len(ends)), np.int64)
    for _ in range(max_steps):
        rows = np.flatnonzero(rounds < len(cutoffs))
        if not len(rows):
            break
        find_nearest(
            ends,
            rows,
            nearest,
            anchors,
            sample.points,
            target.cells.reach,
            target.cells.arrays,
        )
        target.fit_nearest(nearest, rows)
        sizes = step_on_planes(
            ends,
            rows,
            nearest,
            moving,
            target.planes(smooth=smooth),
            cutoffs[rounds[rows]],
            allowed,
        )
        steps[rows] += 1
        rounds[rows] += sizes < tolerances[rounds[rows]]
    criterion: Criterion = "smoothed_point_to_plane" if smooth else "point_to_plane"
    return [
        Minimum(T, bool(ended == len(cutoffs)), int(taken), criterion)
        for T, ended, taken in zip(ends, rounds, steps, strict=True)
    ]


def gradients_at(
    sample: Sample, target: TargetPlanes, poses: Array, *, smooth: bool = False
) -> Array:
    """(K, 6) slopes of the sum of `minimize_point_to_plane`, downhill, at the poses (K, 4, 4).

    Rotation before translation; the sum is taken over its scale, that is of rho(r) = r^2 / 2 at 0.
    """
    nearest, anchors = _nothing_found(len(poses), sample)
    rows = np.arange(len(poses))
    find_nearest(
        poses, rows, nearest, anchors, sample.points, target.cells.reach, target.cells.arrays
    )
    target.fit_nearest(nearest, rows)
    planes, cutoff = target.planes(smooth=smooth), np.float32(target.cutoff)
    gradients: Array = sum_gradients(poses, nearest, _moving(sample), planes, cutoff)
    return gradients


def _nothing_found(count: int, sample: Sample) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Nearest points of the sample at some poses, and their anchors, before any was looked for."""
    shape = count, len(sample.points)
    return np.full(shape, -1, np.int32), np.full((*shape, 4), -1, np.float32)


def _moving(sample: Sample) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Points and normals of the sample, as the kernels take them."""
    normals = np.empty((0, 3), np.float32) if sample.normals is None else sample.normals
    return sample.points, normals
