"""A connection that the server has closed is replaced; one that works costs no question."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing

import psycopg
import pytest
from sqlalchemy import func, select
from sqlalchemy.dialects.postgresql.psycopg import PGDialect_psycopg

from service.database import postgres_liveness
from service.database.postgres import PostgresDatabase
from tests.factories.postgres import Postgres


@pytest.fixture
def database(postgres: Postgres) -> Iterator[PostgresDatabase]:
    with closing(PostgresDatabase(postgres.new_database())) as opened:
        yield opened


@pytest.fixture
def pings(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """Questions to the server whether it is there."""
    asked: list[object] = []
    ping = PGDialect_psycopg.do_ping

    def count(dialect: PGDialect_psycopg, connection: object) -> bool:
        asked.append(connection)
        return bool(ping(dialect, connection))  # type: ignore[arg-type]

    monkeypatch.setattr(PGDialect_psycopg, "do_ping", count)
    return asked


def backend(database: PostgresDatabase) -> int:
    with database.read(single=True) as connection:
        return connection.scalar(select(func.pg_backend_pid())) or 0


def test_a_connection_in_use_is_not_asked(database: PostgresDatabase, pings: list[object]) -> None:
    first = backend(database)
    for _ in range(3):
        assert backend(database) == first
    assert not pings


def test_one_that_the_server_has_closed_is_replaced(
    database: PostgresDatabase, pings: list[object], postgres: Postgres
) -> None:
    lost = backend(database)
    with psycopg.connect(postgres.url("postgres"), autocommit=True) as operator:
        operator.execute("SELECT pg_terminate_backend(%s, 10000)", [lost])
    assert backend(database) != lost
    assert len(pings) == 1


def test_one_that_idled_for_long_is_asked(
    database: PostgresDatabase, pings: list[object], monkeypatch: pytest.MonkeyPatch
) -> None:
    first = backend(database)
    monkeypatch.setattr(postgres_liveness, "MAX_UNASKED_S", 0.0)
    assert backend(database) == first
    assert len(pings) == 1
