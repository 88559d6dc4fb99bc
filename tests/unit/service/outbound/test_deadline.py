"""How long a transfer may take, and how slow it may be."""

from __future__ import annotations

import time

import pytest

from service.outbound.deadline import TransferDeadline, TransferLimits
from service.outbound.errors import (
    FetchTooSlowError,
)
from tests.factories.web import Fetch, Handler, Web


def drip_head(handler: Handler) -> None:
    handler.wfile.write(b"HTTP/1.1 200 OK\r\nX: ")
    handler.drip()


def drip_body(handler: Handler) -> None:
    handler.head(Content_Length=str(10**5))
    handler.drip()


def drip_chunks(handler: Handler) -> None:
    handler.head(Transfer_Encoding="chunked")
    while not handler.server.is_closing.is_set():
        handler.wfile.write(b"1\r\nx\r\n")
        time.sleep(0.02)


def go_on_and_on(handler: Handler) -> None:
    while not handler.server.is_closing.is_set():
        handler.wfile.write(b"HTTP/1.1 100 Continue\r\n\r\n")
        time.sleep(0.02)


SLOW = [drip_head, drip_body, drip_chunks, go_on_and_on]


@pytest.mark.parametrize("behaviour", SLOW)
def test_a_slow_drip_is_too_slow(behaviour: object, web: Web, fetch: Fetch) -> None:
    web.behaviours["/slow"] = behaviour  # type: ignore[assignment]
    with pytest.raises(FetchTooSlowError, match=r"bytes per second|send on in time"):
        fetch(web.url("/slow"), read_timeout_s=0.3, min_bytes_per_s=10_000)


@pytest.mark.parametrize("behaviour", SLOW)
def test_time_is_bounded_whatever_the_speed(behaviour: object, web: Web, fetch: Fetch) -> None:
    web.behaviours["/slow"] = behaviour  # type: ignore[assignment]
    with pytest.raises(FetchTooSlowError):
        fetch(web.url("/slow"), total_s=0.5)


def silent(handler: Handler) -> None:
    handler.server.is_closing.wait(20)


def silent_after_the_head(handler: Handler) -> None:
    handler.head(Content_Length="1000")
    handler.wfile.flush()
    handler.server.is_closing.wait(20)


@pytest.mark.parametrize("behaviour", [silent, silent_after_the_head])
def test_a_server_that_falls_silent_is_left(behaviour: object, web: Web, fetch: Fetch) -> None:
    web.behaviours["/silent"] = behaviour  # type: ignore[assignment]
    with pytest.raises(FetchTooSlowError):
        fetch(web.url("/silent"), read_timeout_s=0.3)


class Clock:
    def __init__(self) -> None:
        self.now = 1000.0


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr("service.outbound.deadline.time.monotonic", lambda: clock.now)
    return clock


def test_no_step_may_take_longer_than_what_is_left(clock: Clock) -> None:
    deadline = TransferDeadline(TransferLimits(total_s=30, read_timeout_s=20))
    assert deadline.remaining() == 20
    clock.now += 25
    assert deadline.remaining() == 5
    clock.now += 5
    with pytest.raises(FetchTooSlowError, match="30 s"):
        deadline.remaining()


def test_the_speed_is_measured_over_each_interval_of_a_connection(clock: Clock) -> None:
    limits = TransferLimits(total_s=1000, read_timeout_s=10, min_bytes_per_s=100)
    deadline = TransferDeadline(limits)
    deadline.start()
    deadline.received(10**6)
    clock.now += 10
    deadline.received(0)  # fast in the first interval
    clock.now += 9
    deadline.received(1)
    deadline.start()  # a new connection begins anew
    deadline.received(1)
    clock.now += 10
    with pytest.raises(FetchTooSlowError, match="100 bytes per second"):
        deadline.received(1)
