"""Problem documents (RFC 9457): what each exception means to a caller, in one table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mpe_core import errors as core
from service.formats.errors import CloudFileError, MissingAttributeError

TYPE_PREFIX = "urn:mpe:problem:"


class ServiceError(Exception):
    """Root of what the service raises on purpose; the message becomes the problem's detail."""

    def __init__(
        self,
        detail: str,
        *,
        headers: dict[str, str] | None = None,
        members: dict[str, Any] | None = None,
    ) -> None:
        super().__init__(detail)
        self.headers = headers or {}
        self.members = members or {}


class InvalidRequestError(ServiceError):
    """The request is well formed but says something that cannot be done."""


class MalformedBodyError(ServiceError):
    """The body does not parse as what its content type says."""


class UnsupportedContentTypeError(ServiceError):
    """The body is neither multipart/form-data nor application/json."""


class NotAcceptableError(ServiceError):
    """The caller accepts none of the formats that there are."""


class BodyTooLargeError(ServiceError):
    """The body exceeds MPE_MAX_BODY_BYTES."""


class UnauthorizedError(ServiceError):
    """No key was given where one is needed, or one that is not valid."""


class HostRefusedError(ServiceError):
    """No key was given, and the service was called by a name that is not its own."""


class OriginRefusedError(ServiceError):
    """No key was given, and a page of another site would change something."""


class RateLimitedError(ServiceError):
    """The key was used more often than it may."""


class QuotaExceededError(ServiceError):
    """The tenant has as much waiting or stored as it may."""


class UnknownRegistrationError(ServiceError):
    """No registration has this id, or it was removed."""


class UnknownCloudError(ServiceError):
    """No cloud has this id, or it was removed or has expired."""


class UnknownUploadError(ServiceError):
    """No upload has this id, or it was removed or has expired."""


class UploadConflictError(ServiceError):
    """A piece does not begin where the upload ends."""


class TusVersionError(ServiceError):
    """The request does not speak the version of tus that is spoken here."""


class ResultNotReadyError(ServiceError):
    """The registration has not succeeded, so there is no result to fetch."""


class AddressRefusedError(ServiceError):
    """A URL was given, but no host may be called, or not this one."""


class FetchError(ServiceError):
    """A URL could not be fetched."""


class FetchNameError(FetchError):
    """The URL's host has no address."""


class FetchTlsError(FetchError):
    """The URL's server is not who it should be, or does not speak TLS."""


class FetchStatusError(FetchError):
    """The URL's server answered, but did not give the file."""


class FetchTooLargeError(FetchError):
    """The URL gives more than may be fetched."""


class FetchTooSlowError(FetchError):
    """The URL's file did not come in time."""


class FetchUnreachableError(FetchError):
    """No connection to the URL's server could be made."""


class FetchCutError(FetchError):
    """The connection to the URL's server ended early."""


class QueueFullError(ServiceError):
    """As many registrations wait as may wait."""


class IdempotencyMismatchError(ServiceError):
    """Another request was made under the same Idempotency-Key."""


class IdempotencyInFlightError(ServiceError):
    """The first request under the same Idempotency-Key is still being read."""


class NoDeliveryError(ServiceError):
    """The registration has not ended, or was given no callback_url."""


class ExpiredError(ServiceError):
    """There was a result, but it was kept long enough."""


class OverloadedError(ServiceError):
    """Too little disk or memory is left to take on more."""


class DeadlineError(ServiceError):
    """The caller's deadline passed first."""


class NotReadyError(ServiceError):
    """The workers are not warm yet, or the service is stopping."""


class JobTimeoutError(ServiceError):
    """The attempt ran longer than it may."""


class JobMemoryError(ServiceError):
    """The attempt needed more memory than it may take."""


class WorkerLostError(ServiceError):
    """The worker ended without an answer, again and again."""


@dataclass(frozen=True, slots=True)
class ProblemType:
    """What stays the same in every problem of one kind."""

    status: int
    name: str
    title: str


INVALID_WEIGHTS = ProblemType(422, "invalid-weights", "The weights do not fit the cloud")
PROBLEM_TYPES: dict[type[Exception], ProblemType] = {
    InvalidRequestError: ProblemType(422, "invalid-request", "The request is not valid"),
    MalformedBodyError: ProblemType(400, "malformed-body", "The body cannot be parsed"),
    UnsupportedContentTypeError: ProblemType(
        415, "unsupported-content-type", "The content type is not supported"
    ),
    UnauthorizedError: ProblemType(401, "unauthorized", "A valid key is needed"),
    HostRefusedError: ProblemType(421, "host-refused", "The service has another name"),
    OriginRefusedError: ProblemType(403, "origin-refused", "Pages of this origin may not call"),
    NotAcceptableError: ProblemType(406, "not-acceptable", "None of the accepted formats exists"),
    BodyTooLargeError: ProblemType(413, "body-too-large", "The body is too large"),
    UnknownRegistrationError: ProblemType(
        404, "unknown-registration", "There is no such registration"
    ),
    UnknownCloudError: ProblemType(404, "unknown-cloud", "There is no such cloud"),
    UnknownUploadError: ProblemType(404, "unknown-upload", "There is no such upload"),
    UploadConflictError: ProblemType(409, "upload-conflict", "The upload is elsewhere"),
    TusVersionError: ProblemType(412, "tus-version", "The version of tus is not spoken"),
    ResultNotReadyError: ProblemType(409, "result-not-ready", "There is no result"),
    AddressRefusedError: ProblemType(403, "address-refused", "The URL may not be called"),
    FetchError: ProblemType(422, "fetch-failed", "The URL could not be fetched"),
    FetchNameError: ProblemType(422, "fetch-name", "The URL's host is unknown"),
    FetchTlsError: ProblemType(422, "fetch-tls", "The URL's server cannot be trusted"),
    FetchStatusError: ProblemType(422, "fetch-status", "The URL does not give a file"),
    FetchTooLargeError: ProblemType(422, "fetch-too-large", "The URL's file is too large"),
    FetchTooSlowError: ProblemType(422, "fetch-too-slow", "The URL's file comes too slowly"),
    QueueFullError: ProblemType(429, "queue-full", "The queue is full"),
    RateLimitedError: ProblemType(429, "rate-limited", "Too many requests"),
    QuotaExceededError: ProblemType(429, "quota-exceeded", "The tenant's share is used up"),
    IdempotencyMismatchError: ProblemType(
        422, "idempotency-mismatch", "The Idempotency-Key belongs to another request"
    ),
    IdempotencyInFlightError: ProblemType(
        409, "idempotency-in-flight", "The first request under this key is still in flight"
    ),
    NoDeliveryError: ProblemType(409, "no-delivery", "There is nothing to deliver"),
    ExpiredError: ProblemType(410, "expired", "The result has expired"),
    OverloadedError: ProblemType(503, "overloaded", "The service is short of disk or memory"),
    DeadlineError: ProblemType(504, "deadline-passed", "The deadline passed"),
    NotReadyError: ProblemType(503, "not-ready", "The service is not ready"),
    JobTimeoutError: ProblemType(504, "job-timeout", "The registration took too long"),
    JobMemoryError: ProblemType(507, "job-memory", "The registration needs too much memory"),
    WorkerLostError: ProblemType(500, "worker-lost", "The worker ended without an answer"),
    CloudFileError: ProblemType(422, "unreadable-cloud", "The file is not a readable point cloud"),
    MissingAttributeError: INVALID_WEIGHTS,
    core.InvalidWeightsError: INVALID_WEIGHTS,
    core.InvalidOptionsError: ProblemType(422, "invalid-options", "The options are not valid"),
    core.CloudShapeError: ProblemType(422, "cloud-shape", "The cloud is not a list of 3-D points"),
    core.TooFewPointsError: ProblemType(422, "too-few-points", "The cloud has too few points"),
    core.DegenerateCloudError: ProblemType(
        422, "degenerate-cloud", "The cloud's points lie on a line or in one place"
    ),
    core.CoordinateRangeError: ProblemType(
        422, "coordinate-range", "The cloud's coordinates are too large"
    ),
    core.RegistrationError: ProblemType(422, "registration-error", "The clouds cannot be aligned"),
}
INTERNAL = ProblemType(500, "internal-error", "Something went wrong in the service")


def problem_type(error: BaseException) -> ProblemType:
    """The kind of problem that the exception is; INTERNAL when it was not foreseen."""
    for ancestor in type(error).__mro__:
        if ancestor in PROBLEM_TYPES:
            return PROBLEM_TYPES[ancestor]
    return INTERNAL


def problem(kind: ProblemType, detail: str, **members: Any) -> dict[str, Any]:
    """The problem document; further members extend it."""
    return {
        "type": TYPE_PREFIX + kind.name,
        "title": kind.title,
        "status": kind.status,
        "detail": detail,
        **members,
    }


def error_problem(error: Exception) -> dict[str, Any]:
    """The problem document of an exception of the table."""
    return problem(problem_type(error), str(error))
