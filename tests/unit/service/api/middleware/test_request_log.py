"""The request log: one line and one measurement per request, and the id that names it."""

from __future__ import annotations

import asyncio
import logging
from pathlib import Path
from typing import Any
from uuid import UUID

import httpx
import pytest
from anyio import BrokenResourceError
from starlette.datastructures import Headers
from starlette.types import Message, Receive, Scope, Send

from service.api.middleware.request_log import NO_RESPONSE, RequestLogMiddleware
from service.app import create_app
from service.auth.authenticator import Caller
from service.auth.keys import KeyLimits
from service.runtime import Runtime
from service.telemetry.json_logs import request_id
from service.telemetry.metrics import Metrics
from tests.factories.api import on_api
from tests.factories.finished import add_finished
from tests.factories.jobs import new_job


def run(
    metrics: Metrics,
    *,
    given: str = "",
    caller: Caller | None = None,
    error: Exception | None = None,
    answers: bool = True,
) -> tuple[str, str]:
    """The id that the route sees, and the one of the response."""
    seen: list[str | None] = []
    sent: list[Message] = []

    async def app(scope: Scope, receive: Receive, send: Send) -> None:
        seen.append(request_id.get())
        if caller is not None:
            scope["caller"] = caller
        if answers:
            await send({"type": "http.response.start", "status": 202, "headers": []})
        if error is not None:
            raise error

    async def send(message: Message) -> None:
        sent.append(message)

    async def receive() -> Message:
        raise AssertionError("nothing is read")

    headers = [(b"x-request-id", given.encode())] if given else []
    scope: dict[str, Any] = {"type": "http", "method": "GET", "path": "/p", "headers": headers}
    asyncio.run(RequestLogMiddleware(app, metrics=metrics)(scope, receive, send))
    return str(seen[0]), Headers(scope=sent[0])["x-request-id"] if sent else ""


def test_the_callers_id_is_kept() -> None:
    assert run(Metrics(), given="scan-7.a_B") == ("scan-7.a_B", "scan-7.a_B")


@pytest.mark.parametrize("given", ["", "two words", "x" * 65, 'a"b'])
def test_any_other_is_replaced_by_a_new_one(given: str) -> None:
    seen, answered = run(Metrics(), given=given)
    assert seen == answered == str(UUID(answered))


def test_each_request_is_logged_and_measured(caplog: pytest.LogCaptureFixture) -> None:
    metrics = Metrics()
    with caplog.at_level(logging.INFO):
        run(metrics, caller=Caller("lab", KeyLimits(), key_id="k1"))
        run(metrics)
    first, second = (record.__dict__ for record in caplog.records)
    assert (first["method"], first["path"], first["status"]) == ("GET", "/p", 202)
    assert (first["tenant"], first["key"]) == ("lab", "k1")
    assert first["duration_ms"] >= 0
    assert "tenant" not in second
    assert b'route="unmatched",status="202"} 2.0' in metrics.exposition()


@pytest.mark.parametrize(
    ("answers", "error", "status"),
    [
        (False, ZeroDivisionError(), 500),
        (False, ExceptionGroup("", [BrokenResourceError()]), NO_RESPONSE),
        (True, ZeroDivisionError(), 202),  # the caller has seen it
    ],
)
def test_an_error_counts_as_500_unless_the_caller_is_gone_or_has_a_status(
    answers: bool, error: Exception, status: int, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.INFO), pytest.raises(type(error)):
        run(Metrics(), answers=answers, error=error)
    assert [record.__dict__["status"] for record in caplog.records] == [status]
    assert request_id.get() is None or request_id.get() == ""


def test_a_request_that_ends_without_a_response_is_no_failure(
    caplog: pytest.LogCaptureFixture,
) -> None:
    metrics = Metrics()
    with caplog.at_level(logging.INFO):
        run(metrics, answers=False)
    assert [record.__dict__["status"] for record in caplog.records] == [NO_RESPONSE]
    assert f'status="{NO_RESPONSE}"}} 1.0'.encode() in metrics.exposition()


def test_what_a_caller_left_is_counted_as_that(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """A body that is cut, a wait, a file whose caller is gone: whatever route it was."""

    async def call(runtime: Runtime, method: str, path: str, *messages: Message) -> None:
        app = create_app(runtime.settings)
        app.state.runtime = runtime
        left = [*messages, {"type": "http.disconnect"}]
        wanted = {"host": "localhost", "prefer": "wait=60", "accept": "application/x-npy"}
        headers = [(name.encode(), value.encode()) for name, value in wanted.items()]
        scope: dict[str, Any] = {"type": "http", "method": method, "path": path, "scheme": "http"}
        scope |= {"headers": headers, "query_string": b"", "root_path": ""}

        async def receive() -> Message:
            return left.pop(0) if len(left) > 1 else left[0]

        async def send(message: Message) -> None:
            """The connection is closed."""

        await app(scope, receive, send)

    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        finished = add_finished(runtime)
        waiting = runtime.submit(new_job(tenant="default"))
        half: Message = {"type": "http.request", "body": b"0 0", "more_body": True}
        whole: Message = {"type": "http.request", "body": b"", "more_body": False}
        await call(runtime, "PUT", "/v1/clouds/a", half)
        await call(runtime, "GET", f"/v1/registrations/{waiting.id}", whole)
        await call(runtime, "GET", f"/v1/registrations/{finished}/inliers", whole)

    with caplog.at_level(logging.INFO, "service.api"):
        on_api(tmp_path, use)
    logged = [record.__dict__["status"] for record in caplog.records if record.msg == "request"]
    assert logged == [NO_RESPONSE] * 3
