"""Transport of messages from a child process to the service process: lines of JSON in a pipe."""

from __future__ import annotations

import os
import time
from multiprocessing.connection import Connection

from service.workers.messages import MAX_MESSAGE_BYTES, Message, MessageError, decode, encode

_READ_BYTES = 1 << 16


class MessageReader:
    """Reads the messages of one child; never waits for the rest of half a message."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._buffer = bytearray()

    def receive(self, timeout_s: float) -> Message | None:
        """Return the next message, or None after the timeout.

        Raises
        ------
        MessageError
            What came is no valid message.
        EOFError
            The child closed its end.
        """
        deadline = time.monotonic() + timeout_s
        while b"\n" not in self._buffer:
            if len(self._buffer) > MAX_MESSAGE_BYTES:
                raise MessageError(f"it sent a message of more than {MAX_MESSAGE_BYTES} bytes")
            if not self._connection.poll(max(0.0, deadline - time.monotonic())):
                return None
            self._buffer += self._read_available()
        line, _, self._buffer = self._buffer.partition(b"\n")
        return decode(bytes(line))

    def _read_available(self) -> bytes:
        try:
            data = os.read(self._connection.fileno(), _READ_BYTES)
        except OSError as error:
            raise EOFError from error
        if not data:
            raise EOFError
        return data


def send_message(connection: Connection, message: Message) -> None:
    """Send a message to the parent.

    Raises
    ------
    ConnectionError
        The parent has closed its end.
    """
    with open(connection.fileno(), "wb", closefd=False) as stream:
        stream.write(encode(message))
