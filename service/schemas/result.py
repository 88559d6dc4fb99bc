"""Models of the result of a registration: pose, confidence, covariance, inliers."""

from __future__ import annotations

from pydantic import Field

from mpe_core.result import WarningCode
from service.schemas.arrays import IndexPair, Matrix4x4, Matrix6x6, Vector3, Vector4, Vector6
from service.schemas.base import ResponseModel

MAX_INLINE_PAIRS = 100_000
"""Most inlier pairs that the result itself holds; `.../inliers` returns any number."""


class Rotation(ResponseModel):
    """The rotation of the transform as a quaternion and an angle."""

    quaternion_xyzw: Vector4 = Field(description="Unit quaternion x, y, z, w with w >= 0; no unit.")
    angle_deg: float = Field(ge=0, le=180, description="Angle of the rotation in degrees.")


class InlierSummary(ResponseModel):
    """Pairs of points that are closer than the threshold at the final pose."""

    count: int = Field(ge=0, description="Number of pairs.")
    ratio: float = Field(ge=0, le=1, description="Share of the source points that are in a pair.")
    threshold: float = Field(ge=0, description="Largest distance of a pair, in the input's unit.")
    pairs: list[IndexPair] | None = Field(
        description="[source index, target index] of each pair, counted from 0 in the order of the "
        f"files, or of the samples of a mesh; null above {MAX_INLINE_PAIRS:,} pairs: fetch "
        ".../inliers then."
    )


class ResultWarning(ResponseModel):
    """What a caller should know before using the result."""

    code: WarningCode = Field(description="Stable name of the warning; new ones may be added.")
    message: str = Field(description="The same in words; its text may change.")


class Result(ResponseModel):
    """The pose of the source in the target's frame, and how far to trust it."""

    transform: Matrix4x4 = Field(
        description="4x4 rigid transform, row-major, for column vectors: "
        "x_target = R x_source + t; the last column in the input's unit. Where the option scale "
        "allows it, a similarity: x_target = scale R x_source + t."
    )
    scale: float = Field(
        gt=0, description="Factor of the transform; 1 unless the option scale allows another."
    )
    scale_deviation: float = Field(
        ge=0, description="Standard deviation of the scale where it is estimated, else 0."
    )
    rotation: Rotation
    translation: Vector3 = Field(description="t of the transform, in the input's unit.")
    overlap: float = Field(
        ge=0, le=1, description="Share of the source points with a counterpart in the target."
    )
    rmse: float = Field(
        ge=0, description="Root mean square distance of the inliers, in the input's unit."
    )
    energy: float = Field(
        description="P2 criterion of the pose, mean over the source, in [-1, 0]; no unit."
    )
    confidence: float = Field(ge=0, le=1, description="How likely the pose is right, in [0, 1].")
    accepted: bool = Field(description="Whether the confidence reaches 0.5.")
    ambiguous: bool = Field(
        description="Whether another pose fits as well: the shape is symmetric or slides on "
        "itself. It may be why the pose is not accepted."
    )
    alternatives: list[Matrix4x4] = Field(
        description="Those other poses, as `transform`; some of them if there are infinitely many."
    )
    covariance: Matrix6x6 = Field(
        description="6x6 covariance of the error of the pose as a small motion: rotation vector "
        "about the moved source's centroid (weighted as its points are) in radians, then "
        "translation in the input's unit, along the target's axes. It covers noise and misfit, not "
        "a wrong pose; along free directions it says a radian or a radius of the smaller cloud."
    )
    free_directions: list[Vector6] = Field(
        description="Such motions that nothing resists, because the surfaces slide on themselves: "
        "none for most shapes, one along a street, three for a plane or a sphere."
    )
    converged: bool = Field(description="Whether the refinement settled before its bound.")
    iterations: int = Field(ge=0, description="Iterations of the last stage; a count.")
    inliers: InlierSummary
    warnings: list[ResultWarning] = Field(
        description="What to know before using the result, about the files first."
    )


class InlierList(ResponseModel):
    """All inlier pairs, ordered by source index."""

    count: int = Field(ge=0, description="Number of pairs.")
    threshold: float = Field(ge=0, description="Largest distance of a pair, in the input's unit.")
    pairs: list[IndexPair] = Field(description="[source index, target index] of each pair.")
    distances: list[float] = Field(description="Distance of each pair, in the input's unit.")
