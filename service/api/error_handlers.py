"""Every error leaves as a problem document (application/problem+json)."""

from __future__ import annotations

import logging
from collections.abc import Awaitable, Callable
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from fastapi.routing import iter_route_contexts
from pydantic import ValidationError
from starlette.exceptions import HTTPException

from service.api.middleware.security_headers import protect
from service.problems import (
    FOREIGN_PROBLEMS,
    INTERNAL,
    TYPE_PREFIX,
    InvalidRequestError,
    ProblemType,
    ServiceError,
    problem_document,
    problem_type,
)
from service.telemetry.metrics import Metrics

log = logging.getLogger(__name__)


class ProblemResponse(JSONResponse):
    """A response whose body is a problem document."""

    media_type = "application/problem+json"

    def __init__(
        self, content: dict[str, Any], status_code: int, headers: dict[str, str] | None
    ) -> None:
        super().__init__(content, status_code, headers)
        self.kind: str = content["type"].removeprefix(TYPE_PREFIX)


Answer = Callable[[Request, Exception], ProblemResponse]
Handler = Callable[[Request, Exception], Awaitable[ProblemResponse]]


def register_error_handlers(app: FastAPI, metrics: Metrics) -> None:
    """Answer every exception with its problem document, and count it."""
    foreseen: tuple[type[Exception], ...] = (ServiceError, *FOREIGN_PROBLEMS)
    handlers = dict.fromkeys(foreseen, _expected) | {
        RequestValidationError: _invalid_parameters,
        HTTPException: _http,
        Exception: _unexpected,
    }
    for exception, answer in handlers.items():
        app.add_exception_handler(exception, _counted(answer, metrics))


def _counted(answer: Answer, metrics: Metrics) -> Handler:
    async def handler(request: Request, error: Exception) -> ProblemResponse:
        response = answer(request, error)
        metrics.problems.labels(response.kind).inc()
        return response

    return handler


def invalid_request(
    error: ValidationError | RequestValidationError, *within: str
) -> InvalidRequestError:
    """Say where the input is wrong and what was expected, without repeating the input."""
    found = [
        {
            "pointer": _pointer((*within, *item["loc"])),
            "detail": item["msg"].removeprefix("Value error, "),
        }
        for item in error.errors()
    ]
    detail = "; ".join(f"{item['pointer'] or '/'}: {item['detail']}" for item in found)
    return InvalidRequestError(detail, members={"errors": found})


def _pointer(location: tuple[int | str, ...]) -> str:
    return "".join(f"/{part}" for part in location)


def _respond(
    kind: ProblemType, detail: str, headers: dict[str, str] | None = None, **members: Any
) -> ProblemResponse:
    return ProblemResponse(
        problem_document(kind, detail, **members), status_code=kind.status, headers=headers
    )


def _expected(request: Request, error: Exception) -> ProblemResponse:
    kind = problem_type(error)
    if kind is INTERNAL:
        return _unexpected(request, error)
    if isinstance(error, ServiceError):
        return _respond(kind, str(error), error.headers, **error.members)
    return _respond(kind, str(error))


def _invalid_parameters(request: Request, error: Exception) -> ProblemResponse:
    assert isinstance(error, RequestValidationError)  # noqa: S101
    return _expected(request, invalid_request(error))


def _http(request: Request, error: Exception) -> ProblemResponse:
    assert isinstance(error, HTTPException)  # noqa: S101
    headers = dict(error.headers or {})
    if error.status_code == HTTPStatus.METHOD_NOT_ALLOWED:
        headers["Allow"] = _allowed(request)
    status = HTTPStatus(error.status_code)
    kind = ProblemType(status.value, status.phrase.lower().replace(" ", "-"), status.phrase)
    return _respond(kind, status.description or status.phrase, headers)


def _allowed(request: Request) -> str:
    """All methods of the path; the router names those of one route of it only."""
    path = request.url.path
    methods = [
        route.methods or set()
        for route in iter_route_contexts(request.app.routes)
        if route.path_regex.fullmatch(path)
    ]
    return ", ".join(sorted(set().union(*methods)))


def _unexpected(request: Request, error: Exception) -> ProblemResponse:
    log.error("unexpected error in %s %s", request.method, request.url.path, exc_info=error)
    answer = _respond(INTERNAL, "The error was logged; the request can be sent again.")
    protect(answer.headers, request.scope)  # it is made outside of the middleware that does so
    return answer
