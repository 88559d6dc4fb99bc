"""What expires when, and which blobs are needed until then."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import pytest
from sqlalchemy import Connection, func, select, update

from service.database.engine import Database
from service.database.tables import jobs
from service.jobs import retention
from service.jobs.queries import JobQueries
from service.jobs.retention import drop_expired, find_needed_blobs
from service.jobs.transitions import JobTransitions
from service.jobs.usage import ROW_BYTES, count_stored_bytes
from tests.factories.jobs import CLOUD, OUTCOME, TENANT, add, claim

COUNT = select(func.count()).select_from(jobs)


def change_ended(database: Database, **values: Any) -> None:
    """Change the rows of the jobs that have ended."""
    with database.write() as connection:
        has_ended = jobs.c.finished_at.is_not(None)
        connection.execute(update(jobs).where(has_ended).values(**values))


def test_results_expire_before_jobs(
    database: Database, transitions: JobTransitions, queries: JobQueries
) -> None:
    done, waiting = add(transitions, work_key="w"), add(transitions)
    transitions.succeed(claim(transitions), OUTCOME, "w")
    drop_expired(database)
    assert find_needed_blobs(database) == {"ab", "result", "inliers"}
    change_ended(database, result_expires_at=time.time() - 1)
    assert add(transitions, work_key="w").status == "queued"
    drop_expired(database)
    row = queries.get(TENANT, done.id)
    assert row is not None
    assert (row.status, row.result_sha256) == ("succeeded", None)
    change_ended(database, expires_at=time.time() - 1)
    drop_expired(database)
    assert queries.get(TENANT, done.id) is None
    assert queries.get(TENANT, waiting.id) == waiting
    assert find_needed_blobs(database) == {"ab"}


def test_others_may_write_while_much_expires(
    database: Database, transitions: JobTransitions, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However many rows there are, no transaction changes more than a few."""
    monkeypatch.setattr(retention, "MAX_ROWS", 2)
    for number in range(5):
        add(transitions, labels={"number": str(number)})
        transitions.cancel(claim(transitions).id)
    kept = add(transitions)
    change_ended(database, expires_at=time.time() - 1)
    sizes: list[int] = []
    write = database.write

    @contextmanager
    def counted(**kind: bool) -> Iterator[Connection]:
        with write(**kind) as connection:
            before = connection.scalar(COUNT)
            yield connection
            sizes.append(before - connection.scalar(COUNT))

    monkeypatch.setattr(database, "write", counted)
    drop_expired(database)
    assert sizes == [2, 2, 1]
    with database.read() as connection:
        assert list(connection.scalars(select(jobs.c.id))) == [kept.id]


def test_a_failed_job_needs_no_clouds(database: Database, transitions: JobTransitions) -> None:
    add(transitions)
    assert find_needed_blobs(database) == {"ab"}
    transitions.fail(claim(transitions), {"detail": "x"}, {})
    assert find_needed_blobs(database) == set()


def test_a_file_counts_once_for_its_tenant(database: Database, transitions: JobTransitions) -> None:
    add(transitions), add(transitions)
    assert CLOUD.size is not None
    with_one = count_stored_bytes(database, TENANT)
    assert CLOUD.size + 2 * ROW_BYTES < with_one < CLOUD.size + 3 * ROW_BYTES
    transitions.succeed(claim(transitions), replace(OUTCOME, warnings=[]), None)
    assert count_stored_bytes(database, TENANT) == with_one + OUTCOME.result_bytes
    assert count_stored_bytes(database, "other") == 0


def test_texts_of_the_caller_count(database: Database, transitions: JobTransitions) -> None:
    add(transitions)
    small = count_stored_bytes(database, TENANT)
    add(transitions, labels={"part": "x" * 50_000})
    long = count_stored_bytes(database, TENANT)
    assert long > small + 50_000
    job = add(transitions, callback_url="http://there/" + "x" * 8000)
    waiting = count_stored_bytes(database, TENANT)
    assert waiting > long + 8000
    transitions.cancel(job.id)
    assert count_stored_bytes(database, TENANT) == waiting + ROW_BYTES  # its callback
