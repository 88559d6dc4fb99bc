"""Rigid registration of point clouds: arrays in, arrays out.

Importing compiles the kernels or loads them from the cache, so that no call waits for a compiler.
"""

from mpe_core.errors import (
    CloudShapeError,
    CoordinateRangeError,
    DegenerateCloudError,
    InvalidCloudError,
    InvalidOptionsError,
    RegistrationError,
    TooFewPointsError,
)
from mpe_core.options import METHODS, Method, RegistrationOptions
from mpe_core.registration import register
from mpe_core.result import Inliers, Registration

__all__ = [
    "METHODS",
    "CloudShapeError",
    "CoordinateRangeError",
    "DegenerateCloudError",
    "Inliers",
    "InvalidCloudError",
    "InvalidOptionsError",
    "Method",
    "Registration",
    "RegistrationError",
    "RegistrationOptions",
    "TooFewPointsError",
    "register",
]
