"""Transactions on each database."""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor

import pytest
from sqlalchemy import insert, select, update

from service.database.engine import Database
from service.database.sqlite import SqliteDatabase
from service.database.tables import api_keys
from service.jobs.queries import JobFilter, JobQueries
from service.problems import InvalidRequestError

KEY = {"id": "k", "tenant": "lab", "name": "0", "secret_sha256": "s", "created_at": 1.0}
"""A row with a text that the tests count up."""


def add_row(database: Database) -> None:
    with database.write() as connection:
        connection.execute(insert(api_keys).values(**KEY))


def count_up(database: Database) -> None:
    """Read, then decide: safe only where nobody else writes in between."""
    with database.write(exclusive=True) as connection:
        name = connection.scalar(select(api_keys.c.name))
        time.sleep(0.001)
        connection.execute(update(api_keys).values(name=str(int(name) + 1)))


def name_of(database: Database) -> str | None:
    with database.read() as connection:
        name: str | None = connection.scalar(select(api_keys.c.name))
    return name


def test_exclusive_transactions_run_one_after_the_other(database: Database) -> None:
    add_row(database)
    with ThreadPoolExecutor(8) as threads:
        list(threads.map(lambda _: count_up(database), range(40)))
    assert name_of(database) == "40"


def test_a_transaction_that_fails_changes_nothing(database: Database) -> None:
    add_row(database)

    def fail_halfway() -> None:
        with database.write() as connection:
            connection.execute(update(api_keys).values(name="half"))
            raise OSError("cut")

    with pytest.raises(OSError, match="cut"):
        fail_halfway()
    assert name_of(database) == "0"


@pytest.mark.parametrize("durable", [True, False])
def test_what_is_committed_can_be_read(database: Database, durable: bool) -> None:
    add_row(database)
    with database.write(durable=durable) as connection:
        connection.execute(update(api_keys).values(name="new"))
        assert name_of(database) == "0"
    assert name_of(database) == "new"


def test_a_single_statement_is_a_transaction_by_itself(database: Database) -> None:
    add_row(database)
    with database.write(single=True) as connection:
        connection.execute(update(api_keys).values(name="new"))
    with database.read(single=True) as connection:
        assert connection.scalar(select(api_keys.c.name)) == "new"


def test_a_reader_sees_one_moment(database: Database) -> None:
    add_row(database)
    with database.read() as connection:
        assert connection.scalar(select(api_keys.c.name)) == "0"
        with database.write() as writer:
            writer.execute(update(api_keys).values(name="new"))
        assert connection.scalar(select(api_keys.c.name)) == "0"


def test_text_that_postgresql_cannot_hold_is_the_callers_fault(database: Database) -> None:
    queries = JobQueries(database)
    if isinstance(database, SqliteDatabase):
        assert queries.get("lab", "a\0b") is None
        return
    with pytest.raises(InvalidRequestError, match="NUL"):
        queries.get("lab", "a\0b")
    with pytest.raises(InvalidRequestError):
        queries.page("lab", limit=9, only=JobFilter(label=("part", "\0")))
