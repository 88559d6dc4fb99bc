"""Connections are counted, and running out of descriptors is a pause."""

from __future__ import annotations

import asyncio
import errno
import logging
import socket
from unittest import mock

import pytest

from service.connections import listener as module
from service.connections.guard import ConnectionGuard
from service.connections.listener import bind
from tests.factories.connections import exchange, listening, serve
from tests.factories.waiting import until

GET = b"GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n"


async def ok(scope, receive, send):  # type: ignore[no-untyped-def]
    """Answer 200."""
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": b""})


def test_more_connections_than_allowed_are_refused_until_some_close() -> None:
    guard = ConnectionGuard(10, 3)

    async def use(port: int) -> None:
        held = [await asyncio.open_connection("127.0.0.1", port) for _ in range(3)]
        await asyncio.sleep(0.05)
        assert (await exchange(port, GET)).startswith(b"HTTP/1.1 503")
        held[0][1].close()
        await asyncio.sleep(0.05)
        assert (await exchange(port, GET)).startswith(b"HTTP/1.1 200")
        for _, writer in held:
            writer.close()
        await asyncio.sleep(0.05)
        assert guard.total == 0

    serve(ok, use, guard=guard)


def test_running_out_of_descriptors_is_a_pause_and_one_line(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "PAUSE_S", 0.05)
    accept, failing, calls = socket.socket.accept, True, 0

    def limited(self: socket.socket) -> object:
        nonlocal calls
        calls += 1
        if failing:
            raise OSError(errno.EMFILE, "Too many open files")
        return accept(self)

    async def use(port: int) -> None:
        nonlocal failing
        answer = asyncio.create_task(exchange(port, GET))
        await asyncio.sleep(0.4)
        assert 2 < calls < 20
        failing = False
        assert (await answer).startswith(b"HTTP/1.1 200")

    with mock.patch.object(socket.socket, "accept", limited), caplog.at_level(logging.ERROR):
        serve(ok, use)
    assert len([r for r in caplog.records if "no connection can be accepted" in r.message]) == 1


def test_sockets_are_bound_at_every_address_of_a_name() -> None:
    async def run() -> None:
        sockets = await bind("localhost", 0)
        assert {item.getsockname()[0] for item in sockets} <= {"127.0.0.1", "::1"}
        port = sockets[0].getsockname()[1]
        for item in sockets:
            item.listen()
        with pytest.raises(OSError, match="in use"):
            await bind(sockets[0].getsockname()[0], port)
        for item in sockets:
            item.close()

    asyncio.run(run())


def test_accepted_connections_probe_a_silent_peer() -> None:
    options: list[int] = []
    keep_alive = module._keep_alive

    def spy(connection: socket.socket) -> None:
        keep_alive(connection)
        options.append(connection.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE))

    async def run() -> None:
        async with listening(ok) as port:
            await exchange(port, GET)

    with mock.patch.object(module, "_keep_alive", spy):
        asyncio.run(run())
    assert options
    assert all(options)


def test_addresses_of_one_host_count_together() -> None:
    guard = ConnectionGuard(10, 2)
    first = guard.admit("2001:db8::1")
    assert first is not None
    assert guard.admit("2001:db8::2") == first
    assert guard.admit("2001:db8::3") is None
    assert guard.admit("2001:db8:0:1::3") is not None
    assert guard.admit("::ffff:192.0.2.1") == "192.0.2.1" == guard.admit("192.0.2.1")
    assert guard.admit("192.0.2.1") is None
    guard.release(first)
    assert guard.admit("2001:db8::3%eth0") == first
    until(lambda: guard.total == 5)
