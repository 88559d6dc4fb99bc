"""What can go wrong with the caller's input.

RegistrationError
├── InvalidOptionsError      an option is unknown, of the wrong type or out of range
└── InvalidCloudError        a cloud cannot be registered
    ├── CloudShapeError      not an (N, 3) array of real numbers
    ├── TooFewPointsError    fewer than 3 finite points are left
    ├── DegenerateCloudError all points on one line or in one place
    ├── CoordinateRangeError a coordinate too large for exact arithmetic
    └── InvalidWeightsError  not one weight of 0 or more for each point

Not converging is a field of the result, never an exception.
"""


class RegistrationError(Exception):
    """Root of everything that mpe_core raises on purpose."""


class InvalidOptionsError(RegistrationError, ValueError):
    """An option is unknown, of the wrong type or out of range."""


class InvalidCloudError(RegistrationError, ValueError):
    """A cloud cannot be registered; the subclass says why."""


class CloudShapeError(InvalidCloudError):
    """Not an (N, 3) array of real numbers."""


class TooFewPointsError(InvalidCloudError):
    """Fewer than 3 finite points; an empty cloud included."""


class DegenerateCloudError(InvalidCloudError):
    """All points lie on one line or in one place: a rotation about it cannot be told."""


class CoordinateRangeError(InvalidCloudError):
    """A finite coordinate so large that float64 cannot hold the geometry."""


class InvalidWeightsError(InvalidCloudError):
    """Not one weight of 0 or more for each point, at least 3 of them above 0."""
