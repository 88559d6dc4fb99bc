"""Scale of a pose: how much larger the source would have to be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mpe_core.refine.target_planes import Correspondences

MIN_MATCHES = 30
"""Matches that a scale takes."""

POINTS_OF_A_PATCH = 10
"""Points that share the error of a plane: they count as one."""


@dataclass(frozen=True, slots=True)
class ScaleStep:
    """Change of the scale at a pose, by the points on planes."""

    log_scale: float
    """Natural logarithm of the factor."""
    deviation: float
    """Its standard deviation."""


def estimate_scale_step(matches: Correspondences, cutoff: float) -> ScaleStep | None:
    """Solve for a small motion and a scale; None where too little matches.

    Parameters
    ----------
    matches
        Points at a pose, with the planes of the other cloud.
    cutoff
        Cut-off of Tukey's loss.
    """
    weights = matches.tukey_weights(cutoff).astype(np.float64)
    used = weights > 0
    if used.sum() < MIN_MATCHES:
        return None
    points = matches.moved[used].astype(np.float64)
    points = points - points.mean(axis=0)
    normals, w = matches.normals[used].astype(np.float64), weights[used]
    residuals = matches.residuals()[used].astype(np.float64)
    J = np.column_stack(
        [np.cross(points, normals), normals, np.einsum("ni,ni->n", points, normals)]
    )
    information = np.einsum("n,ni,nj->ij", w, J, J)
    inverse = np.linalg.pinv(information, rcond=1e-6, hermitian=True)
    solution = inverse @ np.einsum("n,ni,n->i", w, J, residuals)
    left = residuals - np.einsum("ni,i->n", J, solution)
    variance = float((w * left**2).sum() / w.sum()) * POINTS_OF_A_PATCH
    return ScaleStep(float(solution[6]), float(np.sqrt(variance * inverse[6, 6])))
