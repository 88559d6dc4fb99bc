"""Rigid registration of point clouds: arrays in, arrays out.

Importing `register` compiles the kernels or loads them from the cache, so that no call waits for a
compiler; importing the package alone loads no kernel.
"""

from typing import TYPE_CHECKING

from mpe_core.errors import (
    CloudShapeError,
    CoordinateRangeError,
    DegenerateCloudError,
    InvalidCloudError,
    InvalidOptionsError,
    InvalidWeightsError,
    RegistrationError,
    TooFewPointsError,
)
from mpe_core.options import RegistrationOptions
from mpe_core.result import CodedWarning, Inliers, Registration

if TYPE_CHECKING:
    from mpe_core.deviation import Deviation, DeviationSummary, measure_deviation
    from mpe_core.registration import register
    from mpe_core.surfaces import MeshSurface, TargetSurface

__all__ = [
    "CloudShapeError",
    "CodedWarning",
    "CoordinateRangeError",
    "DegenerateCloudError",
    "Deviation",
    "DeviationSummary",
    "Inliers",
    "InvalidCloudError",
    "InvalidOptionsError",
    "InvalidWeightsError",
    "MeshSurface",
    "Registration",
    "RegistrationError",
    "RegistrationOptions",
    "TargetSurface",
    "TooFewPointsError",
    "measure_deviation",
    "register",
]
_DEVIATION = ("Deviation", "DeviationSummary", "measure_deviation")
_SURFACES = ("MeshSurface", "TargetSurface")


def __getattr__(name: str) -> object:
    if name == "register":
        from mpe_core.registration import register

        return register
    if name in _DEVIATION:
        from mpe_core import deviation

        return getattr(deviation, name)
    if name in _SURFACES:
        from mpe_core import surfaces

        return getattr(surfaces, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
