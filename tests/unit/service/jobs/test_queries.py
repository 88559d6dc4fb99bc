"""Lists of jobs, their filters, and the borders between tenants."""

from __future__ import annotations

import time

from service.jobs.model import JobStatus
from service.jobs.queries import JobFilter, JobQueries
from service.jobs.transitions import JobTransitions
from tests.factories.jobs import TENANT, add, claim


def test_a_job_is_its_tenants_own(transitions: JobTransitions, queries: JobQueries) -> None:
    job = add(transitions)
    assert queries.get(TENANT, job.id) == job
    assert queries.get("other", job.id) is None
    assert queries.get(TENANT, "unknown") is None
    assert queries.page("other", limit=9) == []
    assert len(queries.events(TENANT, job.id, after=0)) == 1
    assert queries.events("other", job.id, after=0) == []
    assert queries.get_unscoped(job.id) == job


def test_jobs_are_counted_by_tenant_or_all(
    transitions: JobTransitions, queries: JobQueries
) -> None:
    add(transitions), add(transitions), add(transitions, tenant="other")
    claim(transitions)
    assert (queries.count("running"), queries.count("queued")) == (1, 2)
    assert queries.count("queued", TENANT) == queries.count("queued", "other") == 1


def test_the_age_of_the_queue_is_that_of_its_oldest_job(
    transitions: JobTransitions, queries: JobQueries
) -> None:
    assert queries.queue_age_s() == 0
    moment = queries.present()
    add(transitions, created_at=moment - 7000), add(transitions, created_at=moment - 1000)
    assert 7000 <= queries.queue_age_s() < 8000
    claim(transitions)
    assert 1000 <= queries.queue_age_s() < 2000


def test_pages_cover_jobs_of_the_same_instant(
    transitions: JobTransitions, queries: JobQueries
) -> None:
    moment = time.time()
    for _ in range(7):
        add(transitions, created_at=moment)
    seen: list[str] = []
    page = queries.page(TENANT, limit=3)
    while page:
        seen += [job.id for job in page]
        page = queries.page(TENANT, limit=3, before=(page[-1].created_at, page[-1].id))
    assert len(seen) == len(set(seen)) == 7


def test_list_is_filtered(transitions: JobTransitions, queries: JobQueries) -> None:
    start = time.time()
    claimed = add(transitions, labels={"part": "door"}).id
    queued = add(transitions, labels={"part": "wing", "shift": "2"}).id
    claim(transitions)

    def ids(
        *,
        status: JobStatus | None = None,
        label: tuple[str, str] | None = None,
        after: float | None = None,
        before: float | None = None,
    ) -> list[str]:
        only = JobFilter(status, label, created_after=after, created_before=before)
        return [job.id for job in queries.page(TENANT, limit=9, only=only)]

    assert ids() == [queued, claimed]
    assert ids(status="queued") == [queued]
    assert ids(label=("part", "wing")) == [queued]
    assert ids(label=("part", "roof")) == []
    assert ids(status="running", label=("part", "wing")) == []
    assert ids(after=start) == [queued, claimed]
    assert ids(before=start) == []
