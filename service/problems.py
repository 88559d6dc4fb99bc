"""Exceptions of the service, and the problem document (RFC 9457) that each one becomes.

A class states its problem once: HTTP status, type, title, and when the request may be repeated.
Errors of `mpe_core` and `service.formats` know nothing of HTTP; FOREIGN_PROBLEMS lists theirs.
Errors of fetching URLs are in `service.outbound.errors`.
"""

from __future__ import annotations

import errno
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar, Self

from mpe_core import errors as core
from service.formats.errors import CloudFileError, MissingAttributeError

TYPE_PREFIX = "urn:mpe:problem:"


@dataclass(frozen=True, slots=True)
class ProblemType:
    """The members of a problem document that all problems of one type share."""

    status: int
    slug: str
    """Last part of the type URI, after TYPE_PREFIX."""
    title: str


INTERNAL = ProblemType(500, "internal-error", "Something went wrong in the service")
"""The type of every exception that has none of its own."""


class ServiceError(Exception):
    """Root of the exceptions that the service raises on purpose.

    Parameters
    ----------
    detail : str
        What was expected, what came and what to do; shown to the caller.
    retry_after_s : float, optional
        Seconds until the request may be repeated; default: that of the class.
    headers : dict, optional
        Further headers of the response.
    members : dict, optional
        Further members of the problem document.
    """

    problem: ProblemType = INTERNAL
    retry_after_s: ClassVar[float | None] = None
    """Seconds until the request may be repeated (header Retry-After); None: not stated."""

    def __init__(
        self,
        detail: str,
        *,
        retry_after_s: float | None = None,
        headers: dict[str, str] | None = None,
        members: dict[str, Any] | None = None,
    ) -> None:
        super().__init__(detail)
        self.headers = dict(headers or {})
        self.members = members or {}
        wait_s = self.retry_after_s if retry_after_s is None else retry_after_s
        if wait_s is not None:
            self.headers["Retry-After"] = str(math.ceil(wait_s))


class InvalidRequestError(ServiceError):
    """The request is well formed, but asks for something impossible."""

    problem = ProblemType(422, "invalid-request", "The request is not valid")


class MalformedBodyError(ServiceError):
    """The body does not parse as its content type."""

    problem = ProblemType(400, "malformed-body", "The body cannot be parsed")


class UnsupportedContentTypeError(ServiceError):
    """The body is neither multipart/form-data nor application/json."""

    problem = ProblemType(415, "unsupported-content-type", "The content type is not supported")


class UnauthorizedError(ServiceError):
    """A key is required, and none or an invalid one was sent."""

    problem = ProblemType(401, "unauthorized", "A valid key is needed")


class HostRefusedError(ServiceError):
    """A request without a key names a host that is not allowed."""

    problem = ProblemType(421, "host-refused", "Host not allowed")


class OriginRefusedError(ServiceError):
    """A page of another origin sent a request without a key that changes something."""

    problem = ProblemType(403, "origin-refused", "Pages of this origin may not call")


class NotAcceptableError(ServiceError):
    """The Accept header names no format that the resource has."""

    problem = ProblemType(406, "not-acceptable", "None of the accepted formats exists")


class BodyTooLargeError(ServiceError):
    """The body exceeds MPE_MAX_BODY_BYTES."""

    problem = ProblemType(413, "body-too-large", "The body is too large")


class ConnectionClosedError(ServiceError):
    """The caller closed the connection before the answer; nobody receives this."""

    problem = ProblemType(
        499, "client-closed-request", "The connection was closed before the answer"
    )


class UnknownRegistrationError(ServiceError):
    """No registration has this id, or it was removed."""

    problem = ProblemType(404, "unknown-registration", "There is no such registration")


class UnknownCloudError(ServiceError):
    """No cloud has this id, or it was removed or has expired."""

    problem = ProblemType(404, "unknown-cloud", "There is no such cloud")


class UnknownUploadError(ServiceError):
    """No upload has this id, or it was removed or has expired."""

    problem = ProblemType(404, "unknown-upload", "There is no such upload")


class UploadConflictError(ServiceError):
    """The Upload-Offset of a PATCH is not the number of bytes received so far."""

    problem = ProblemType(409, "upload-conflict", "Upload-Offset does not match")


class NoDirectTransferError(ServiceError):
    """Callers do not reach the store of the files."""

    problem = ProblemType(409, "no-direct-transfer", "The service offers no direct transfer")


class PageNotFoundError(ServiceError):
    """The page, or a file of it, does not exist."""

    problem = ProblemType(404, "unknown-page", "There is no such page")


class TusVersionError(ServiceError):
    """The Tus-Resumable header names no supported version."""

    problem = ProblemType(412, "tus-version", "The version of tus is not spoken")


class ResultNotReadyError(ServiceError):
    """The registration has not succeeded, so it has no result."""

    problem = ProblemType(409, "result-not-ready", "There is no result")


class QueueFullError(ServiceError):
    """MPE_QUEUE_LIMIT registrations are waiting."""

    problem = ProblemType(429, "queue-full", "The queue is full")
    retry_after_s = 5


class RateLimitedError(ServiceError):
    """The key was used more often than its requests per second allow."""

    problem = ProblemType(429, "rate-limited", "Too many requests")


class QuotaExceededError(ServiceError):
    """The tenant has as many registrations waiting, or bytes stored, as its limits allow."""

    problem = ProblemType(429, "quota-exceeded", "The tenant's share is used up")
    retry_after_s = 60


class IdempotencyMismatchError(ServiceError):
    """The Idempotency-Key was first used with another request."""

    problem = ProblemType(
        422, "idempotency-mismatch", "The Idempotency-Key belongs to another request"
    )


class IdempotencyInFlightError(ServiceError):
    """The first request with the same Idempotency-Key has not been answered yet."""

    problem = ProblemType(
        409, "idempotency-in-flight", "The first request under this key is still in flight"
    )
    retry_after_s = 1


class NoDeliveryError(ServiceError):
    """The registration has not ended, or has no callback_url."""

    problem = ProblemType(409, "no-delivery", "There is nothing to deliver")


class ExpiredError(ServiceError):
    """A result or a cloud existed: its retention time has passed, or its file is missing."""

    problem = ProblemType(410, "expired", "The result has expired")


class OverloadedError(ServiceError):
    """Too little disk or memory is left to accept more."""

    problem = ProblemType(503, "overloaded", "The service is short of disk, memory or files")
    retry_after_s = 30


class DiskFullError(ServiceError):
    """The disk of the service, or its quota, is full."""

    problem = ProblemType(507, "disk-full", "The disk of the service is full")
    retry_after_s = 30

    def __init__(self) -> None:
        super().__init__("The disk of the service is full; nothing was stored. Retry later.")


class NoDescriptorError(ServiceError):
    """The process has as many files and connections open as it may."""

    problem = OverloadedError.problem
    retry_after_s = 5

    def __init__(self) -> None:
        super().__init__("The service has too many files open; retry later.")


class DeadlineError(ServiceError):
    """The caller's deadline passed before the registration ended."""

    problem = ProblemType(504, "deadline-passed", "The deadline passed")


class NotReadyError(ServiceError):
    """The workers are starting, the service is stopping, or the job store does not answer."""

    problem = ProblemType(503, "not-ready", "The service is not ready")
    retry_after_s = 5


class BlobsUnavailableError(NotReadyError):
    """The store of the files does not answer."""


class JobTimeoutError(ServiceError):
    """The attempt took longer than MPE_JOB_TIMEOUT_S."""

    problem = ProblemType(504, "job-timeout", "The registration took too long")


class JobMemoryError(ServiceError):
    """The attempt needed more than MPE_JOB_MEMORY_BYTES, or than the machine has."""

    problem = ProblemType(507, "job-memory", "The registration needs too much memory")

    @classmethod
    def beyond(cls, limit_bytes: int) -> Self:
        """Return the error of an attempt that needed more than its limit."""
        return cls(
            f"It needs more than the allowed {limit_bytes / 2**20:.0f} MiB: send smaller clouds, or"
            " allow more (MPE_JOB_MEMORY_BYTES)."
        )


class WorkerLostError(ServiceError):
    """Every attempt ended without an answer of its worker."""

    problem = ProblemType(500, "worker-lost", "The worker ended without an answer")


_INVALID_WEIGHTS = ProblemType(422, "invalid-weights", "The weights do not fit the cloud")
FOREIGN_PROBLEMS: dict[type[Exception], ProblemType] = {
    CloudFileError: ProblemType(422, "unreadable-cloud", "The file is not a readable point cloud"),
    MissingAttributeError: _INVALID_WEIGHTS,
    core.InvalidWeightsError: _INVALID_WEIGHTS,
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
"""Problem types of exceptions that are defined below the service; subclasses inherit them."""


def problem_type(error: BaseException) -> ProblemType:
    """Return the type of problem that an exception is; INTERNAL when it was not foreseen."""
    if isinstance(error, ServiceError):
        return error.problem
    if is_disk_full(error):
        return DiskFullError.problem
    if is_out_of_descriptors(error):
        return NoDescriptorError.problem
    for ancestor in type(error).__mro__:
        if ancestor in FOREIGN_PROBLEMS:
            return FOREIGN_PROBLEMS[ancestor]
    return INTERNAL


def is_out_of_descriptors(error: BaseException | None) -> bool:
    """Return whether the error, or one that it came from, is that no further file can be opened."""
    return _has_errno(error, {errno.EMFILE, errno.ENFILE})


def is_disk_full(error: BaseException | None) -> bool:
    """Return whether the error, or one that it came from, is that of a full disk or quota."""
    return _has_errno(error, {errno.ENOSPC, errno.EDQUOT})


def is_out_of_memory(error: BaseException | None) -> bool:
    """Return whether the error is a lack of memory, or came from one that the system told."""
    return isinstance(error, MemoryError) or _has_errno(error, {errno.ENOMEM})


def _has_errno(error: BaseException | None, numbers: set[int]) -> bool:
    while error is not None:
        if isinstance(error, OSError) and error.errno in numbers:
            return True
        error = error.__cause__ or error.__context__
    return False


def all_problem_types() -> list[ProblemType]:
    """Return every problem type of the modules imported so far, each once."""
    own = (error.problem for error in _subclasses(ServiceError))
    return list(dict.fromkeys((*own, *FOREIGN_PROBLEMS.values(), INTERNAL)))


def _subclasses(error: type[ServiceError]) -> Iterator[type[ServiceError]]:
    for subclass in error.__subclasses__():
        yield subclass
        yield from _subclasses(subclass)


def problem_document(kind: ProblemType, detail: str, **members: Any) -> dict[str, Any]:
    """Return the problem document of this type; further members extend it."""
    return {
        "type": TYPE_PREFIX + kind.slug,
        "title": kind.title,
        "status": kind.status,
        "detail": detail,
        **members,
    }


def error_document(error: Exception) -> dict[str, Any]:
    """Return the problem document of an exception, without its further members."""
    kind = problem_type(error)
    if kind is DiskFullError.problem:
        error = DiskFullError()  # the text of another error may hold a path
    return problem_document(kind, str(error))
