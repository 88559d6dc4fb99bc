"""A finished registration as the documents that the API serves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation as SciPyRotation

from mpe_core import Inliers, Registration
from service.schemas import INLINE_PAIRS, InlierSummary, Result, Rotation

INLIER_DTYPE = np.dtype([("source", "<i8"), ("target", "<i8"), ("distance", "<f8")])


def result_document(found: Registration) -> bytes:
    """JSON of the `result` of a job."""
    T = found.T_target_source
    rotation = SciPyRotation.from_matrix(T[:3, :3])
    return (
        Result(
            transform=T.tolist(),
            rotation=Rotation(
                quaternion_xyzw=rotation.as_quat(canonical=True).tolist(),
                angle_deg=float(np.degrees(rotation.magnitude())),
            ),
            translation=T[:3, 3].tolist(),
            overlap=found.overlap,
            rmse=found.rmse,
            energy=found.energy,
            confidence=found.confidence,
            accepted=found.accepted,
            ambiguous=found.ambiguous,
            alternatives=found.alternatives.tolist(),
            covariance=found.covariance.tolist(),
            free_directions=found.free_directions.tolist(),
            converged=found.converged,
            iterations=found.iterations,
            inliers=_summary(found),
        )
        .model_dump_json()
        .encode()
    )


def inlier_array(inliers: Inliers) -> NDArray[np.void]:
    """(K,) structured array of source index, target index, distance in the input's unit."""
    rows = np.empty(len(inliers), INLIER_DTYPE)
    rows["source"] = inliers.source
    rows["target"] = inliers.target
    rows["distance"] = inliers.distance
    return rows


def _summary(found: Registration) -> InlierSummary:
    inliers = found.inliers
    inline = len(inliers) <= INLINE_PAIRS
    pairs = np.column_stack((inliers.source, inliers.target)).tolist() if inline else None
    # not validated: 100,000 pairs would take longer than the registration
    return InlierSummary.model_construct(
        count=len(inliers), ratio=found.overlap, threshold=inliers.threshold, pairs=pairs
    )
