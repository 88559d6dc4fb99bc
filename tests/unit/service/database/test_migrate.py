"""An older job store is brought up to date without loss, whoever opens it, however often."""

from __future__ import annotations

import multiprocessing
import shutil
from collections.abc import Iterator
from contextlib import closing
from multiprocessing.synchronize import Barrier
from pathlib import Path
from typing import Any

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import (
    Connection,
    Engine,
    MetaData,
    create_engine,
    insert,
    inspect,
    make_url,
    select,
    text,
)

from service.database.engine import open_database
from service.database.migrate import STEPS, is_current, migrate
from service.database.tables import metadata
from service.jobs.queries import JobFilter, JobQueries
from tests.factories.jobs import OUTCOME, claim, open_transitions

NEXT = """
from alembic import op
from sqlalchemy import BigInteger, Column, Integer

revision = "next"
down_revision = "{head}"


def upgrade() -> None:
    with op.batch_alter_table("jobs") as jobs:
        jobs.alter_column("priority", type_=BigInteger)
        jobs.add_column(Column("weight", Integer, nullable=False, server_default="7"))
"""

LAST = len(list((STEPS / "versions").glob("v*.py")))
FIRST_EXPANDED = 5
"""The step to version 4 made a table anew; those after it leave what earlier services use."""
CLOUD = {"sha256": "ab", "size": 3_000_000_000, "url": None, "cloud": None, "reading": {}}


@pytest.fixture
def engine(url: str) -> Iterator[Engine]:
    drivername = "sqlite" if url.startswith("sqlite") else "postgresql+psycopg"
    opened = create_engine(make_url(url).set(drivername=drivername))
    yield opened
    opened.dispose()


def fill_version_1(connection: Connection) -> None:
    """A job that has succeeded, one that waits, one that runs, and what belongs to them."""
    migrate(connection, to="1")
    tables = MetaData()
    tables.reflect(connection)

    def add(name: str, **values: Any) -> None:
        connection.execute(insert(tables.tables[name]).values(**values))

    common = {"created_at": 1e9, "attempt": 1, "lost_attempts": 0, "source": CLOUD}
    common |= {"target": CLOUD, "options": {"seed": 1}, "warnings": ["odd"], "priority": 2}
    common |= {"labels": {"part": "door"}, "cached": False, "callback_url": "http://a/b"}
    ended = {"status": "succeeded", "stage": "finished", "fraction": 1.0, "confidence": 0.9}
    ended |= {"timing": {"total_s": 1.0}, "result_sha256": "r", "finished_at": 2e9}
    waits = {"status": "queued", "stage": "queued", "fraction": 0.0, "timing": {}}
    add("jobs", id="done", **common, **ended)
    add("jobs", id="waits", **common, **waits)
    runs = waits | {"status": "running", "started_at": 1e9, "lease_until": 1e9 + 30}
    add("jobs", id="runs", **(common | {"priority": 1}), **runs)
    for job in ("done", "waits", "runs"):
        fields = {"status": "queued", "stage": "queued", "fraction": 0.0}
        add("events", job_id=job, number=1, at=1e9, **fields)
        add("idempotency_keys", key=job, fingerprint="f", job_id=job)
    call = {"status": "pending", "created_at": 1e9, "next_at": 2e9, "tries": [{"at": 1e9}]}
    add("deliveries", id="d", job_id="done", **call)
    add("clouds", id="c", sha256="ab", size=3_000_000_000, format="ply", created_at=1, expires_at=9)
    add("uploads", id="u", length=3_000_000_000, is_complete=False, expires_at=9)


def contents(connection: Connection) -> dict[str, list[dict[str, Any]]]:
    """Every row of every table of version 1, with its columns."""
    tables = MetaData()
    tables.reflect(connection)
    return {
        name: [dict(row) for row in connection.execute(select(table)).mappings()]
        for name, table in tables.tables.items()
        if name != "alembic_version"
    }


def is_kept(
    before: dict[str, list[dict[str, Any]]], after: dict[str, list[dict[str, Any]]]
) -> bool:
    """Whether each row is still there, with its values, whatever columns came to it."""
    return all(
        len(after[name]) == len(rows)
        and all(any(_holds(new, row) for new in after[name]) for row in rows)
        for name, rows in before.items()
    )


def test_the_steps_make_the_tables_of_this_release(url: str, engine: Engine) -> None:
    open_database(url).close()
    with engine.connect() as connection:
        context = MigrationContext.configure(connection, opts={"compare_type": True})
        assert compare_metadata(context, metadata) == []


def test_a_store_of_version_1_is_brought_up_to_date_without_loss(url: str, engine: Engine) -> None:
    with engine.begin() as connection:
        fill_version_1(connection)
        before = contents(connection)
    open_database(url).close()
    with engine.connect() as connection:
        assert is_kept(before, contents(connection))


def test_an_upgraded_store_works(url: str, engine: Engine) -> None:
    with engine.begin() as connection:
        fill_version_1(connection)
    database = open_database(url)
    queries = JobQueries(database)
    done = queries.get("default", "done")
    assert done is not None
    assert (done.status, done.labels, done.result_sha256) == ("succeeded", {"part": "door"}, "r")
    assert done.source.size == 3_000_000_000
    assert queries.get("lab", "done") is None
    found = queries.page("default", limit=9, only=JobFilter(words=("door", "done")))
    assert [job.id for job in found] == ["done"]
    claimed = claim(open_transitions(database))
    assert (claimed.id, claimed.attempt) == ("waits", 2)
    database.close()


@pytest.mark.parametrize("version", range(1, 1 + LAST))
def test_a_store_of_each_version_goes_on(url: str, engine: Engine, version: int) -> None:
    """What had ended is there, what ran is run again, what waited waits."""
    with engine.begin() as connection:
        fill_version_1(connection)
        migrate(connection, to=str(version))
    with closing(open_database(url)) as database:
        transitions, queries = open_transitions(database), JobQueries(database)
        assert transitions.requeue_orphans() == 1
        for job_id in ("waits", "runs"):
            job = claim(transitions)
            assert (job.id, job.attempt) == (job_id, 2)
            assert transitions.succeed(job, OUTCOME, None)
        assert queries.count_by_status()["succeeded"] == 3
        assert [event.number for event in queries.events("default", "runs", after=1)] == [2, 3, 4]


def columns_of(connection: Connection) -> dict[str, dict[str, Any]]:
    found = inspect(connection)
    return {
        name: {column["name"]: column for column in found.get_columns(name)}
        for name in found.get_table_names()
    }


def test_a_step_leaves_what_services_of_the_release_before_use(engine: Engine) -> None:
    """They go on meanwhile: nothing of theirs is gone, and they need not fill what is new."""
    with engine.begin() as connection:
        migrate(connection, to=str(FIRST_EXPANDED - 1))
        before = columns_of(connection)
        for version in range(FIRST_EXPANDED, 1 + LAST):
            migrate(connection, to=str(version))
            after = columns_of(connection)
            for table, columns in before.items():
                for name, column in columns.items():
                    assert str(after[table][name]["type"]) == str(column["type"]), (table, name)
                for name in set(after[table]) - set(columns):
                    new = after[table][name]
                    assert new["nullable"] or new["default"] is not None, (version, table, name)
            before = after


def test_what_a_service_of_the_release_before_accepts_is_run(url: str, engine: Engine) -> None:
    earlier = MetaData()
    with engine.begin() as connection:
        migrate(connection, to=str(LAST - 1))
        earlier.reflect(connection)
    with closing(open_database(url)) as database:
        job = {"id": "new", "tenant": "t", "source": CLOUD, "target": CLOUD, "options": {}}
        job |= {"created_at": 1e9, "status": "queued", "stage": "queued", "fraction": 0.0}
        job |= {"attempt": 0, "lost_attempts": 0, "timing": {}, "warnings": [], "labels": {}}
        job |= {"priority": 0, "cached": False, "queue": "register"}
        with engine.begin() as connection:
            connection.execute(insert(earlier.tables["jobs"]).values(**job))
            turn = {"tenant": "t", "queue": "register", "turn": 0}
            connection.execute(insert(earlier.tables["turns"]).values(**turn))
        transitions = open_transitions(database)
        claimed = claim(transitions)
        assert claimed.id == "new"
        assert transitions.succeed(claimed, OUTCOME, None)


def test_a_step_that_makes_a_table_anew_keeps_what_refers_to_it(
    url: str, engine: Engine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with engine.begin() as connection:
        fill_version_1(connection)
    open_database(url).close()
    with engine.connect() as connection:
        before = contents(connection)
        head = MigrationContext.configure(connection).get_current_revision()
    steps = tmp_path / "steps"
    shutil.copytree(STEPS, steps)
    (steps / "versions" / "next.py").write_text(NEXT.format(head=head))
    monkeypatch.setattr(migrate, "__kwdefaults__", {"to": "head", "steps": steps})
    monkeypatch.setattr(is_current, "__kwdefaults__", {"steps": steps})
    open_database(url).close()
    with engine.connect() as connection:
        after = contents(connection)
    assert is_kept(before, after)
    assert [job["weight"] for job in after["jobs"]] == [7, 7, 7]


def test_opening_again_changes_nothing(url: str, engine: Engine) -> None:
    with engine.begin() as connection:
        fill_version_1(connection)
    open_database(url).close()
    with engine.connect() as connection:
        before = contents(connection)
    open_database(url).close()
    with engine.connect() as connection:
        assert contents(connection) == before


def test_many_processes_may_open_an_old_store_at_once(url: str, engine: Engine) -> None:
    with engine.begin() as connection:
        fill_version_1(connection)
        before = contents(connection)
    spawn = multiprocessing.get_context("spawn")
    together = spawn.Barrier(3)
    openers = [spawn.Process(target=_open_with_others, args=(url, together)) for _ in range(3)]
    for opener in openers:
        opener.start()
    for opener in openers:
        opener.join()
    assert [opener.exitcode for opener in openers] == [0, 0, 0]
    with engine.connect() as connection:
        assert is_kept(before, contents(connection))


def test_a_store_that_counted_its_versions_itself_is_taken_over(url: str, engine: Engine) -> None:
    with engine.begin() as connection:
        fill_version_1(connection)
        before = contents(connection)
        connection.execute(text("DROP TABLE alembic_version"))
        connection.execute(text("CREATE TABLE schema_version (version INTEGER PRIMARY KEY)"))
        connection.execute(text("INSERT INTO schema_version VALUES (1)"))
    open_database(url).close()
    with engine.connect() as connection:
        assert is_kept(before, contents(connection))
        assert not inspect(connection).has_table("schema_version")


def test_a_store_of_a_later_release_is_refused(url: str, engine: Engine) -> None:
    open_database(url).close()
    with engine.begin() as connection:
        connection.execute(text("UPDATE alembic_version SET version_num = '99'"))
    with pytest.raises(RuntimeError, match=r"version 99.*use the release that wrote it"):
        open_database(url)


def _open_with_others(url: str, together: Barrier) -> None:
    together.wait()
    open_database(url).close()


def _holds(new: dict[str, Any], old: dict[str, Any]) -> bool:
    return all(new[column] == value for column, value in old.items())
