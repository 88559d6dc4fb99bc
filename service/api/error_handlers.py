"""Error handlers: every error becomes a problem document (application/problem+json)."""

from __future__ import annotations

import logging
from collections.abc import Awaitable, Callable
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic import ValidationError
from starlette.exceptions import HTTPException

from service.api.disconnect import is_disconnect
from service.api.middleware.security_headers import add_security_headers
from service.api.route_methods import route_methods
from service.problems import (
    FOREIGN_PROBLEMS,
    INTERNAL,
    TYPE_PREFIX,
    DiskFullError,
    InvalidRequestError,
    NoDescriptorError,
    ProblemType,
    ServiceError,
    is_out_of_descriptors,
    problem_document,
    problem_type,
)
from service.telemetry.json_logs import mark_logged
from service.telemetry.metrics import Metrics

log = logging.getLogger(__name__)


class ProblemResponse(JSONResponse):
    """A response whose body is a problem document; `kind` is the last part of its type."""

    media_type = "application/problem+json"

    def __init__(
        self, content: dict[str, Any], status_code: int, headers: dict[str, str] | None
    ) -> None:
        super().__init__(content, status_code, headers)
        self.kind: str = content["type"].removeprefix(TYPE_PREFIX)


Renderer = Callable[[Request, Exception], ProblemResponse]
Handler = Callable[[Request, Exception], Awaitable[ProblemResponse]]


def register_error_handlers(app: FastAPI, metrics: Metrics) -> None:
    """Answer every exception with its problem document, and count it."""
    foreseen: tuple[type[Exception], ...] = (ServiceError, *FOREIGN_PROBLEMS)
    renderers = dict.fromkeys(foreseen, _render_foreseen) | {
        OSError: _render_foreseen,
        RequestValidationError: _render_invalid_parameters,
        HTTPException: _render_http_exception,
        Exception: _render_unexpected,
    }
    for exception, render in renderers.items():
        app.add_exception_handler(exception, _counted(render, metrics))


def _counted(render: Renderer, metrics: Metrics) -> Handler:
    async def handler(request: Request, error: Exception) -> ProblemResponse:
        response = render(request, error)
        metrics.problems.labels(response.kind).inc()
        return response

    return handler


def invalid_request(
    error: ValidationError | RequestValidationError, *parents: str
) -> InvalidRequestError:
    """Convert a validation error; the detail does not repeat the input, which may hold secrets.

    Parameters
    ----------
    error : ValidationError or RequestValidationError
        What pydantic found.
    parents : str
        Path in the request of the document that was validated; its errors' pointers begin with it.
    """
    mistakes = [
        {
            "pointer": "".join(f"/{part}" for part in (*parents, *item["loc"])),
            "detail": item["msg"].removeprefix("Value error, "),
        }
        for item in error.errors()
    ]
    detail = "; ".join(f"{item['pointer'] or '/'}: {item['detail']}" for item in mistakes)
    return InvalidRequestError(detail, members={"errors": mistakes})


def _respond(
    kind: ProblemType, detail: str, headers: dict[str, str] | None = None, **members: Any
) -> ProblemResponse:
    return ProblemResponse(
        problem_document(kind, detail, **members), status_code=kind.status, headers=headers
    )


def _render_foreseen(request: Request, error: Exception) -> ProblemResponse:
    kind = problem_type(error)
    if kind is INTERNAL:
        return _render_unexpected(request, error)
    if kind is DiskFullError.problem:
        error = DiskFullError()  # the text of another error may hold a path
    if not isinstance(error, ServiceError) and is_out_of_descriptors(error):
        error = NoDescriptorError()
    if isinstance(error, ServiceError):
        return _respond(kind, str(error), error.headers, **error.members)
    return _respond(kind, str(error))


def _render_invalid_parameters(request: Request, error: Exception) -> ProblemResponse:
    assert isinstance(error, RequestValidationError)  # noqa: S101
    return _render_foreseen(request, invalid_request(error))


def _render_http_exception(request: Request, error: Exception) -> ProblemResponse:
    assert isinstance(error, HTTPException)  # noqa: S101
    headers = dict(error.headers or {})
    if error.status_code == HTTPStatus.METHOD_NOT_ALLOWED:
        methods = route_methods(request.app, request.url.path)
        headers["Allow"] = ", ".join(sorted(methods | ({"HEAD"} if "GET" in methods else set())))
    status = HTTPStatus(error.status_code)
    kind = ProblemType(status.value, status.phrase.lower().replace(" ", "-"), status.phrase)
    return _respond(kind, status.description or status.phrase, headers)


def _render_unexpected(request: Request, error: Exception) -> ProblemResponse:
    if not is_disconnect(error):
        log.error("unexpected error in %s %s", request.method, request.url.path, exc_info=error)
    mark_logged(error)
    response = _respond(INTERNAL, "The service logged an unexpected error; retry the request.")
    # Starlette answers unexpected errors outside of the middleware
    add_security_headers(response.headers, request.scope)
    return response
