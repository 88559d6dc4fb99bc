"""Exceptions of calls to URLs that callers gave.

ServiceError
├── AddressRefusedError      the policy does not allow the URL
└── FetchError               the URL could not be fetched
    ├── FetchNameError       its host has no address
    ├── FetchTlsError        TLS failed
    ├── FetchStatusError     the status is not 200
    ├── FetchTooLargeError   the file exceeds the limit
    ├── FetchTooSlowError    resolving, connecting, waiting or reading exceeded its limit
    ├── FetchUnreachableError  no connection was made; problem type of FetchError
    └── FetchCutError        the connection ended early; problem type of FetchError
"""

from __future__ import annotations

from service.problems import ProblemType, ServiceError


class AddressRefusedError(ServiceError):
    """The policy does not allow calling the URL, or any URL."""

    problem = ProblemType(403, "address-refused", "The URL may not be called")


class FetchError(ServiceError):
    """A URL could not be fetched; the subclass tells in which phase it failed."""

    problem = ProblemType(422, "fetch-failed", "The URL could not be fetched")


class FetchNameError(FetchError):
    """The URL's host has no address."""

    problem = ProblemType(422, "fetch-name", "The URL's host is unknown")


class FetchTlsError(FetchError):
    """The server's certificate is not valid, or it does not speak TLS."""

    problem = ProblemType(422, "fetch-tls", "The URL's server cannot be trusted")


class FetchStatusError(FetchError):
    """The server answered with a status other than 200."""

    problem = ProblemType(422, "fetch-status", "The URL does not give a file")


class FetchTooLargeError(FetchError):
    """The file exceeds MPE_MAX_BODY_BYTES."""

    problem = ProblemType(422, "fetch-too-large", "The URL's file is too large")


class FetchTooSlowError(FetchError):
    """Resolving, connecting, waiting or reading exceeded its time limit."""

    problem = ProblemType(422, "fetch-too-slow", "The URL's file comes too slowly")


class FetchUnreachableError(FetchError):
    """No connection to the URL's server could be made."""


class FetchCutError(FetchError):
    """The connection to the URL's server ended before the whole response had arrived."""
