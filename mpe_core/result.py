"""Result of a registration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Self, get_args

import numpy as np
from numpy.typing import NDArray

WarningCode = Literal[
    "file",
    "viewpoints_inferred",
    "rows_not_finite",
    "rows_zeros",
    "rows_far",
    "rows_copies",
    "rows_shell",
    "not_converged",
    "low_confidence",
    "free_space",
    "layers",
    "other_units",
    "units_changed",
    "mirrored",
    "other_scale",
    "ambiguous",
    "free_directions",
    "settled_by_color",
    "no_inliers",
]
"""Stable names of warnings (docs/when-it-says-no.md); "file" is about how a file was read."""
WARNING_CODES: tuple[WarningCode, ...] = get_args(WarningCode)


class CodedWarning(str):
    """Text of a warning, with a stable code."""

    code: WarningCode
    """What it is about, for programs."""

    def __new__(cls, code: WarningCode, message: str) -> Self:
        """Make a warning of a code and a text."""
        warning = super().__new__(cls, message)
        warning.code = code
        return warning

    def __getnewargs__(self) -> tuple[WarningCode, str]:  # type: ignore[override]
        """Return what `__new__` takes, for copies and pickles."""
        return self.code, str(self)


@dataclass(frozen=True, slots=True)
class Inliers:
    """Correspondences within the threshold at the final pose, ordered by source index.

    Indices refer to the clouds as the caller passed them, ignored rows included.
    """

    source: NDArray[np.int64]
    """(K,) indices into the source."""
    target: NDArray[np.int64]
    """(K,) indices of the nearest target points."""
    distance: NDArray[np.float64]
    """(K,) distances in the unit of the input."""
    threshold: float
    """Largest distance that counts, in the unit of the input."""

    def __len__(self) -> int:
        return len(self.source)

    def rmse(self) -> float:
        """Root mean square distance, in the unit of the input; 0 if there are no inliers."""
        return float(np.sqrt(np.mean(self.distance**2))) if len(self) else 0.0


@dataclass(frozen=True, slots=True)
class Registration:
    """Pose of the source in the target's frame, and how far to trust it.

    Examples
    --------
    >>> import numpy as np
    >>> from mpe_core import register
    >>> cloud = np.random.default_rng(0).normal(size=(500, 3)) ** 3
    >>> result = register(cloud, cloud + [1, 2, 3])
    >>> result.T_target_source.round(3) + 0.0
    array([[1., 0., 0., 1.],
           [0., 1., 0., 2.],
           [0., 0., 1., 3.],
           [0., 0., 0., 1.]])
    >>> len(result.inliers), result.converged, result.ambiguous
    (500, True, False)
    """

    T_target_source: NDArray[np.float64]
    """(4, 4) rigid transform of column vectors: x_target = R x_source + t, with t in the unit of
    the input."""
    inliers: Inliers
    """Correspondences at the pose."""
    overlap: float
    """Share of the (finite) source points that are inliers, in [0, 1]."""
    rmse: float
    """Root mean square distance of the inliers, in the unit of the input."""
    energy: float
    """P2 criterion (Eq. 10 of the paper) at the pose, mean over the source, in [-1, 0]."""
    converged: bool
    """Whether the last step of the refinement was below the tolerance."""
    iterations: int
    """Iterations of the refinement on the full clouds ("mpl") or of Algorithm 1 ("mpe")."""
    confidence: float
    """Probability that the pose is right, in [0, 1]; at most 0.7 where others fit as well."""
    accepted: bool
    """Whether the confidence is at least 0.5, from which on a pose is taken for right. It is less
    where both clouds show one plane alone."""
    ambiguous: bool
    """Whether another pose fits as well: the shape is symmetric, or slides on itself. It may be why
    the pose is not accepted."""
    alternatives: NDArray[np.float64]
    """(K, 4, 4) those other poses, in the form of T_target_source; some of them, where a shape has
    infinitely many."""
    covariance: NDArray[np.float64]
    """(6, 6) covariance of the error of the pose as a small motion: rotation vector (radians) about
    the moved source's centroid (weighted as its points are), then translation (unit of the input),
    along the target's axes. It covers noise and misfit, not a wrong minimum; along free directions
    the standard deviation is a radian or a radius of the smaller cloud."""
    free_directions: NDArray[np.float64]
    """(K, 6) such motions along which the surfaces slide on themselves, so that the pose is
    undetermined: none for most shapes, one along a street, three for a plane or a sphere."""
    scale: float
    """Factor that the transform scales the source by: 1 unless `scale` of the options allows
    another. The transform is then a similarity, x_target = scale R x_source + t."""
    warnings: tuple[CodedWarning, ...]
    """What a caller should know before using the result: strings, each with a stable `code`."""
    timing: dict[str, float]
    """Seconds by stage: prepare, search, refine, inliers, total."""
    scale_deviation: float = 0.0
    """Standard deviation of the scale where it is estimated, else 0."""
