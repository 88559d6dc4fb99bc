"""Responses written to a connection before the application sees a request."""

from __future__ import annotations

import json
from http import HTTPStatus

from service.api.middleware.security_headers import SECURITY_HEADERS
from service.problems import ProblemType, problem_document


def http_problem(status: int) -> ProblemType:
    """Return the problem type of a status that no exception of the service has."""
    known = HTTPStatus(status)
    return ProblemType(status, known.phrase.lower().replace(" ", "-"), known.phrase)


def refusal(status: int, detail: str, *, retry_after_s: int | None = None) -> bytes:
    """Return a whole HTTP response with a problem document, after which the connection closes."""
    kind = http_problem(status)
    body = json.dumps(problem_document(kind, detail)).encode()
    headers = {
        "Content-Type": "application/problem+json",
        "Content-Length": str(len(body)),
        "Cache-Control": "no-store",
        "Connection": "close",
        **SECURITY_HEADERS,
    }
    if retry_after_s is not None:
        headers["Retry-After"] = str(retry_after_s)
    lines = [f"HTTP/1.1 {status} {kind.title}", *(f"{k}: {v}" for k, v in headers.items())]
    return "\r\n".join(lines).encode() + b"\r\n\r\n" + body
