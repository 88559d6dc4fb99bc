"""Errors in the caller's input.

RegistrationError
├── InvalidOptionsError      an option is unknown, of the wrong type or out of range
└── InvalidCloudError        a cloud cannot be registered
    ├── CloudShapeError      not an (N, 3) array of real numbers
    ├── TooFewPointsError    fewer than 3 finite points are left
    ├── DegenerateCloudError all points on one line or in one place
    ├── CoordinateRangeError a coordinate too large for exact arithmetic
    └── InvalidWeightsError  not one weight of 0 or more for each point

A registration that does not converge raises nothing: `Registration.converged` is False.
"""


class RegistrationError(Exception):
    """Base of all errors that mpe_core raises on purpose."""


class InvalidOptionsError(RegistrationError, ValueError):
    """An option is unknown, of the wrong type or out of range."""


class InvalidCloudError(RegistrationError, ValueError):
    """A cloud cannot be registered; the subclass says why."""


class CloudShapeError(InvalidCloudError):
    """The cloud is not an (N, 3) array of real numbers."""


class TooFewPointsError(InvalidCloudError):
    """The cloud has fewer than 3 finite points, or none."""


class DegenerateCloudError(InvalidCloudError):
    """All points lie on one line or in one place, so that a rotation is undetermined."""


class CoordinateRangeError(InvalidCloudError):
    """A finite coordinate is too large for the geometry to be exact in float64."""


class InvalidWeightsError(InvalidCloudError):
    """There is not one weight of 0 or more for each point, at least 3 of them above 0."""
