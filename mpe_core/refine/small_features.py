"""Small features decide motions along which the rest of the surfaces slides: the key of a shaft.

The information is a mean over all points, to which a feature of a hundredth of them adds little.
Here the surfaces are moved along the motion, and laid on each other again in all others: where the
residuals rise by more than their scatter over the patches of the surface, a feature holds them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpe_core.clouds.preprocess import Sample
from mpe_core.geometry.cell_list import CellList
from mpe_core.kernels.rigid_motion import update_pose
from mpe_core.refine.gauss_newton import minimize_point_to_plane
from mpe_core.refine.target_planes import Correspondences, TargetPlanes, match_planes

Array = NDArray[np.float64]

STEP = 4.0
"""Distance by which points are moved, in cut-offs of the residuals: a feature lets go, and is still
within the reach of the planes (docs/tuning.md)."""

DISPLACEMENT_QUANTILE = 0.98
"""Share of the points that a step moves by at most that."""

REFINE_STEPS = 4
"""Gauss-Newton steps in the other motions: they follow the curve of a motion along the surface."""

PATCH = 0.5
"""Edge of the patches over the radius of the planes: a feature has to lie in many."""

MIN_RISE, MIN_SIGNIFICANCE = 0.01, 5.0
"""Mean rise of the loss, from 0 to 1 for a point, and its number of standard deviations, from which
on a motion is held (docs/tuning.md)."""


def is_held(sample: Sample, planes: TargetPlanes, T: Array, motion: Array, others: Array) -> bool:
    """Whether features resist a motion from the pose T, both ways.

    Parameters
    ----------
    sample
        Points of the moving cloud; the more, the smaller the features that are seen.
    planes
        Planes of the fixed cloud.
    T
        (4, 4) pose at a minimum.
    motion
        (6,) motion, rotation before translation, along which most of the surface slides.
    others
        (6, K) motions in which the surfaces are laid on each other again.
    """
    here = match_planes(sample, planes, T)
    displacement = np.linalg.norm(np.cross(motion[:3], here.moved) + motion[3:], axis=1)
    step = STEP * planes.cutoff / float(np.quantile(displacement, DISPLACEMENT_QUANTILE))
    rise = sum(
        _rise(here, _match_beside(sample, planes, T, side * step * motion, others), planes.cutoff)
        for side in (-1, 1)
    )
    edge = PATCH * planes.radius
    patches = CellList(here.moved, edge, edge=edge)
    sums = np.add.reduceat(np.asarray(rise)[patches.rows], patches.starts[:-1])
    total, scatter = float(sums.sum()), float(np.sqrt(np.square(sums).sum()))
    return total > MIN_RISE * len(here.moved) and total > MIN_SIGNIFICANCE * scatter


def _match_beside(
    sample: Sample, planes: TargetPlanes, T: Array, motion: Array, others: Array
) -> Correspondences:
    """Match at the pose moved by the motion (6,), and refined in the other motions (6, K)."""
    T = T.copy()
    update_pose(T, motion)
    (found,) = minimize_point_to_plane(sample, planes, T[None], others, REFINE_STEPS, is_near=True)
    return match_planes(sample, planes, found.T)


def _rise(here: Correspondences, there: Correspondences, cutoff: float) -> Array:
    """(N,) rise of Tukey's loss; 0 for points that end beyond the planes or at a border."""
    known = here.in_range & there.in_range
    for matches in (here, there):
        known &= (np.abs(matches.normals).sum(axis=1) > 0) & ~np.isnan(matches.variation)
    losses = [_loss(matches, cutoff) for matches in (here, there)]
    return np.where(known, losses[1] - losses[0], 0.0)


def _loss(matches: Correspondences, cutoff: float) -> Array:
    """(N,) Tukey's loss of the residuals over its bound."""
    u = np.minimum(np.abs(matches.residuals().astype(np.float64)) / cutoff, 1.0)
    return np.asarray(1 - (1 - u**2) ** 3)
