"""The request log: one line and one measurement per request, and the id that names it."""

from __future__ import annotations

import asyncio
import logging
from typing import Any
from uuid import UUID

import pytest
from starlette.datastructures import Headers
from starlette.types import Message, Receive, Scope, Send

from service.api.middleware.request_log import RequestLogMiddleware
from service.auth.authenticator import Caller
from service.auth.keys import KeyLimits
from service.telemetry.json_logs import request_id
from service.telemetry.metrics import Metrics


def run(
    metrics: Metrics, *, given: str = "", caller: Caller | None = None, fails: bool = False
) -> tuple[str, str]:
    """The id that the route sees, and the one of the response."""
    seen: list[str | None] = []
    sent: list[Message] = []

    async def app(scope: Scope, receive: Receive, send: Send) -> None:
        seen.append(request_id.get())
        if caller is not None:
            scope["caller"] = caller
        if fails:
            raise ZeroDivisionError
        await send({"type": "http.response.start", "status": 202, "headers": []})

    async def send(message: Message) -> None:
        sent.append(message)

    async def receive() -> Message:
        raise AssertionError("nothing is read")

    headers = [(b"x-request-id", given.encode())] if given else []
    scope: dict[str, Any] = {"type": "http", "method": "GET", "path": "/p", "headers": headers}
    asyncio.run(RequestLogMiddleware(app, metrics=metrics)(scope, receive, send))
    return str(seen[0]), Headers(scope=sent[0])["x-request-id"]


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


def test_an_error_counts_as_500(caplog: pytest.LogCaptureFixture) -> None:
    metrics = Metrics()
    with caplog.at_level(logging.INFO), pytest.raises(ZeroDivisionError):
        run(metrics, fails=True)
    assert [record.__dict__["status"] for record in caplog.records] == [500]
    assert request_id.get() is None or request_id.get() == ""
