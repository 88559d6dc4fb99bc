"""Messages arrive in order, and no child can make its reader wait or fail in another way."""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Iterator
from multiprocessing.connection import Connection

import pytest

from service.workers.messages import MAX_MESSAGE_BYTES, Exported, MessageError, Progress, encode
from service.workers.pipe import MessageReader, send_message

Pipe = tuple[MessageReader, Connection]


@pytest.fixture
def pipe() -> Iterator[Pipe]:
    ours, theirs = multiprocessing.Pipe()
    yield MessageReader(ours), theirs
    ours.close()
    theirs.close()


def write(connection: Connection, data: bytes) -> None:
    os.write(connection.fileno(), data)


def test_messages_arrive_in_order(pipe: Pipe) -> None:
    reader, child = pipe
    sent = [Progress("decode", 0.1), Progress("search", 0.5), Exported()]
    for message in sent:
        send_message(child, message)
    assert [reader.receive(1) for _ in sent] == sent
    assert reader.receive(0) is None


def test_a_message_in_pieces_arrives_whole(pipe: Pipe) -> None:
    reader, child = pipe
    line = encode(Exported()) + encode(Progress("decode", 0.1))
    for i in range(len(line)):
        write(child, line[i : i + 1])
        if reader.receive(0) is not None:
            break
    else:
        pytest.fail("the first message never arrived")
    write(child, line[i + 1 :])
    assert reader.receive(1) == Progress("decode", 0.1)


@pytest.mark.parametrize("half", [b"", b'{"kind": "exp', b"\x7f\xff\xff\xff"])
def test_half_a_message_is_not_waited_for(pipe: Pipe, half: bytes) -> None:
    """The four bytes announce 2 GiB in the framing of multiprocessing."""
    reader, child = pipe
    if half:
        write(child, half)
    start = time.monotonic()
    assert reader.receive(0.05) is None
    assert 0.05 <= time.monotonic() - start < 5


def test_a_closed_pipe_is_the_end_even_after_half_a_message(pipe: Pipe) -> None:
    reader, child = pipe
    send_message(child, Exported())
    write(child, b'{"kind"')
    child.close()
    assert reader.receive(1) == Exported()
    with pytest.raises(EOFError):
        reader.receive(1)


def test_nonsense_is_refused(pipe: Pipe) -> None:
    reader, child = pipe
    write(child, b'{"stage": 3}\n')
    with pytest.raises(MessageError):
        reader.receive(1)


def test_a_line_without_end_is_refused_before_it_fills_the_memory(pipe: Pipe) -> None:
    reader, child = pipe
    sent = 0

    def flood() -> None:
        nonlocal sent
        while sent < 4 * MAX_MESSAGE_BYTES:
            write(child, b"x" * 4096)
            sent += 4096
            assert reader.receive(0) is None

    with pytest.raises(MessageError, match="more than"):
        flood()
    assert sent < 2 * MAX_MESSAGE_BYTES


def test_a_reader_that_is_gone_is_noticed(pipe: Pipe) -> None:
    reader, child = pipe
    reader._connection.close()
    with pytest.raises(ConnectionError):
        send_message(child, Exported())
