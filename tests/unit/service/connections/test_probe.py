"""GET /livez is answered as soon as it is parsed, and as the route would answer it."""

from __future__ import annotations

import asyncio
import logging
import re
from pathlib import Path
from unittest import mock

import pytest
from starlette.types import Receive, Scope, Send
from uvicorn.server import ServerState

from service.api.liveness import liveness_app
from service.app import create_app
from service.connections.protocol import GuardedConfig, GuardedProtocol, Timeouts
from service.settings import Settings
from service.telemetry.metrics import Metrics
from tests.factories.connections import exchange, serve

GET = b"GET /livez HTTP/1.1\r\nHost: localhost\r\nX-Request-ID: me\r\n"
CLOSE = b"Connection: close\r\n\r\n"


async def refuse(scope: Scope, receive: Receive, send: Send) -> None:
    """Answer 404: what comes here is no probe."""
    await send({"type": "http.response.start", "status": 404, "headers": []})
    await send({"type": "http.response.body", "body": b""})


def test_the_answer_is_that_of_the_route() -> None:
    app = create_app(Settings(data_dir=Path("/none")))

    async def ask(port: int) -> None:
        heads = GET, GET + b"If-None-Match: *\r\n"
        answers.extend([await exchange(port, head + CLOSE) for head in heads])

    answers: list[bytes] = []
    serve(app, ask)
    serve(refuse, ask, liveness=app.state.liveness)
    by_route, known, at_once, known_at_once = (_sorted(answer) for answer in answers)
    assert at_once == by_route
    assert known_at_once == known
    assert by_route[0].startswith(b"HTTP/1.1 200")
    assert known[0].startswith(b"HTTP/1.1 304")


def _sorted(answer: bytes) -> list[bytes]:
    """Status line, headers by name but for the date, body."""
    head, _, body = answer.partition(b"\r\n\r\n")
    status, *headers = re.sub(rb"\r\ndate: [^\r]*", b"", head, flags=re.IGNORECASE).split(b"\r\n")
    return [status, *sorted(header.lower() for header in headers), body]


def test_it_waits_for_no_turn_of_the_loop() -> None:
    async def run() -> None:
        config = GuardedConfig(
            refuse,
            timeouts=Timeouts(5, 5),
            liveness=liveness_app(Metrics()),
            log_config=None,
            lifespan="off",
        )
        transport = mock.Mock(**{"is_closing.return_value": False})
        protocol = GuardedProtocol(config, ServerState(), {})
        protocol.connection_made(transport)
        protocol.data_received(GET + b"\r\n")
        (answer,) = transport.write.call_args.args
        assert answer.startswith(b"HTTP/1.1 200")
        assert answer.endswith(b'{"status":"ok"}')
        protocol.connection_lost(None)

    asyncio.run(run())


def test_it_is_logged_and_measured(caplog: pytest.LogCaptureFixture) -> None:
    metrics = Metrics()

    async def use(port: int) -> None:
        await exchange(port, GET + CLOSE)

    with caplog.at_level(logging.INFO):
        serve(refuse, use, liveness=liveness_app(metrics))
    assert [r.__dict__["path"] for r in caplog.records if r.message == "request"] == ["/livez"]
    assert 'method="GET",route="/livez",status="200"} 1.0' in metrics.exposition().decode()


@pytest.mark.parametrize(
    "head",
    [
        GET + b"Origin: https://other.example\r\n",
        GET + b"X-Forwarded-Proto: https\r\n",
        GET + b"Content-Length: 0\r\n",
        GET.replace(b"/livez", b"/livez?a"),
        GET.replace(b"GET", b"HEAD"),
    ],
)
def test_other_requests_go_through_the_application(head: bytes) -> None:
    async def use(port: int) -> None:
        assert (await exchange(port, head + CLOSE)).startswith(b"HTTP/1.1 404")

    serve(refuse, use, liveness=liveness_app(Metrics()))


def test_of_many_at_once_one_is_answered_in_each_step() -> None:
    """The others are tasks: a caller with many holds nobody up."""

    async def use(port: int) -> None:
        answer = await exchange(port, (GET + b"\r\n") * 40 + GET + CLOSE)
        statuses = re.findall(rb"HTTP/1.1 (\d+)", answer)
        assert len(statuses) == 41
        assert 1 <= statuses.count(b"200") < 41

    serve(refuse, use, liveness=liveness_app(Metrics()))


def test_between_two_probes_the_connection_idles() -> None:
    async def use(port: int) -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        for _ in range(4):  # together longer than a head may take
            writer.write(GET + b"\r\n")
            assert (await reader.readuntil(b"}")).startswith(b"HTTP/1.1 200")
            await asyncio.sleep(0.1)
        assert await asyncio.wait_for(reader.read(), 5) == b""
        writer.close()

    serve(refuse, use, liveness=liveness_app(Metrics()), head_s=0.2, idle_s=1)


@pytest.mark.parametrize(
    ("sent", "status"),
    [
        (GET + b"Host: other\r\n" + CLOSE, b"400"),
        (GET + b"A: b\r\n c\r\n" + CLOSE, b"400"),
        (b"BREW /livez HTTP/1.1\r\nHost: a\r\n\r\n" * 50, b"501"),
    ],
)
def test_what_is_no_request_is_refused_once(sent: bytes, status: bytes) -> None:
    async def use(port: int) -> None:
        answer = await exchange(port, sent)
        assert re.findall(rb"HTTP/1.1 (\d+)", answer) == [status]
        assert b"application/problem+json" in answer

    serve(refuse, use, liveness=liveness_app(Metrics()))
