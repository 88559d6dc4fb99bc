"""A server that several services share, when the machine of one is suspended."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import closing

import pytest
from sqlalchemy import text

from service.database import postgres as module
from service.database.postgres import PostgresDatabase
from service.problems import NotReadyError
from tests.factories.postgres import Postgres

WITHIN_S = 20


@pytest.fixture
def url(postgres: Postgres) -> str:
    return str(postgres.new_database())


@pytest.fixture
def suspended(url: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[PostgresDatabase]:
    """One whose transactions the server ends soon."""
    monkeypatch.setattr(module, "MAX_IDLE_MS", 200)
    with closing(PostgresDatabase(url)) as database:
        yield database


def test_who_is_suspended_in_a_transaction_holds_up_nobody_for_long(
    url: str, suspended: PostgresDatabase
) -> None:
    has_begun, goes_on = threading.Event(), threading.Event()
    ends: list[BaseException | None] = []

    def hold() -> None:
        try:
            with suspended.write(exclusive=True) as connection:
                has_begun.set()
                goes_on.wait(WITHIN_S)
                connection.execute(text("SELECT 1"))
        except NotReadyError as error:
            ends.append(error)

    holder = threading.Thread(target=hold)
    holder.start()
    assert has_begun.wait(WITHIN_S)
    with closing(PostgresDatabase(url)) as other, other.write(exclusive=True):
        pass
    goes_on.set()
    holder.join(WITHIN_S)
    assert len(ends) == 1
    with suspended.write(exclusive=True):  # on a new connection
        pass
