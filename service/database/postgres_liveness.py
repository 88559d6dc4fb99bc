"""Connections of the pool that the server has closed are replaced before they are used."""

from __future__ import annotations

import select
import time
from typing import Any

from sqlalchemy import Engine, event
from sqlalchemy.exc import InvalidatePoolError

MAX_UNASKED_S = 30.0
"""Seconds that a connection may idle and still be used without a question to the server: a
firewall or pooler between may have dropped it by then."""
_RETURNED_AT = "returned_at"


def replace_lost_connections(engine: Engine) -> None:
    """Look at each connection that is taken from the pool, without a round trip where it is busy.

    SQLAlchemy's own `pool_pre_ping` asks the server before each transaction.
    """

    def remember(_: object, record: Any) -> None:
        record.info[_RETURNED_AT] = time.monotonic()

    def check(connection: Any, record: Any, _: object) -> None:
        returned_at = record.info.pop(_RETURNED_AT, None)
        if returned_at is None:  # it is new
            return
        idle_s = time.monotonic() - returned_at
        if idle_s < MAX_UNASKED_S and not _has_unread(connection):
            return
        try:
            engine.dialect.do_ping(connection)
        except engine.dialect.loaded_dbapi.Error as error:
            raise InvalidatePoolError from error  # the pool opens new ones

    event.listen(engine, "checkin", remember)
    event.listen(engine, "checkout", check)


def _has_unread(connection: Any) -> bool:
    """Return whether the server has sent something unasked: that it has closed, or a notice."""
    poll = select.poll()
    poll.register(connection.fileno(), select.POLLIN | select.POLLHUP | select.POLLERR)
    return bool(poll.poll(0))
