"""Jobs in an empty database, written and read."""

from __future__ import annotations

import pytest

from service.database.engine import Database
from service.jobs.queries import JobQueries
from service.jobs.transitions import JobTransitions
from tests.factories.jobs import open_transitions


@pytest.fixture
def transitions(database: Database) -> JobTransitions:
    return open_transitions(database)


@pytest.fixture
def queries(database: Database) -> JobQueries:
    return JobQueries(database)
