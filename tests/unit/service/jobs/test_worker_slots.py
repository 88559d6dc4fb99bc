"""The slots of all services that are there count."""

from __future__ import annotations

from service.database.engine import Database
from service.jobs.worker_slots import SLOTS_LEASE_S, WorkerSlots
from tests.factories.clock_of_tests import pass_time


def test_slots_of_all_services_are_added(database: Database) -> None:
    first, second, api = (WorkerSlots(database, number) for number in (2, 3, 0))
    for service in (first, second, api):
        service.announce()
        service.announce()
    assert api.count() == 5
    second.withdraw()
    assert first.count() == 2


def test_a_service_that_is_gone_no_longer_counts(
    database: Database,
) -> None:
    gone, alive = WorkerSlots(database, 2), WorkerSlots(database, 3)
    gone.announce()
    pass_time(database, SLOTS_LEASE_S + 1)
    alive.announce()
    assert alive.count() == 3


def test_at_the_start_nobody_is_counted_who_cannot_be_there(database: Database) -> None:
    """Only one process uses an SQLite file: the slots of an earlier one are none."""
    WorkerSlots(database, 2).announce()
    anew = WorkerSlots(database, 3)
    anew.begin()
    assert anew.count() == (3 if database.orphan_cutoff() == float("inf") else 5)
