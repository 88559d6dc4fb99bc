"""What one process announces another hears, once it is committed."""

from __future__ import annotations

import queue
import threading
from contextlib import closing
from pathlib import Path

import psycopg
import pytest

from service.database import postgres_listener
from service.database.engine import open_database
from tests.factories.postgres import Postgres
from tests.factories.waiting import until

PATIENCE_S = 30


def test_messages_are_heard_once_they_are_committed(
    postgres: Postgres, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(postgres_listener, "RECONNECT_S", 0.01)
    url = postgres.new_database()
    heard: queue.Queue[str] = queue.Queue()
    is_listening = threading.Event()
    with closing(open_database(url)) as one, closing(open_database(url)) as other:

        def announce(message: str) -> None:
            with other.write() as connection:
                other.announce(connection, message)

        with closing(one.listen(heard.put, is_listening.set)):
            assert is_listening.wait(PATIENCE_S)
            with other.write() as connection:
                other.announce(connection, "rolled back")
                connection.rollback()
            announce("first")
            assert heard.get(timeout=PATIENCE_S) == "first"
            is_listening.clear()
            with psycopg.connect(url, autocommit=True) as connection:
                connection.execute(
                    "SELECT pg_terminate_backend(pid) FROM pg_stat_activity"
                    " WHERE application_name = 'mpe-listen' AND datname = current_database()"
                )
            assert is_listening.wait(PATIENCE_S)  # it says that something may have been missed
            announce("second")
            assert heard.get(timeout=PATIENCE_S) == "second"


def test_one_process_leads_and_another_follows(
    postgres: Postgres, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(postgres_listener, "RECONNECT_S", 0.01)
    monkeypatch.setattr(postgres_listener, "WAIT_S", 0.01)
    url = postgres.new_database()
    with closing(open_database(url)) as one, closing(open_database(url)) as other:
        first = one.listen(print, lambda: None)
        until(lambda: first.is_leader)
        with closing(other.listen(print, lambda: None)) as second:
            assert (second.is_leader, second.led_s) == (False, 0)
            first.close()
            until(lambda: second.led_s > 0)
            assert (first.is_leader, first.led_s) == (False, 0)


def test_a_single_process_leads(tmp_path: Path) -> None:
    with (
        closing(open_database(f"sqlite:///{tmp_path / 'jobs.sqlite3'}")) as database,
        closing(database.listen(print, lambda: None)) as alone,
    ):
        assert alone.is_leader
