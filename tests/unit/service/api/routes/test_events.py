"""The stream of events tells the end, whenever it comes."""

from __future__ import annotations

from pathlib import Path

import httpx
import pytest

from service.api.routes import events as module
from service.jobs.model import JobEvent
from service.runtime import Runtime
from tests.factories.api import on_api
from tests.factories.jobs import claim, new_job


@pytest.mark.parametrize("when", ["before", "after"])
def test_a_cancel_beside_a_look_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, when: str
) -> None:
    """The registration is cancelled just before or after the stream reads nothing new."""

    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        job = runtime.submit(new_job(tenant="default"))
        first = runtime.jobs.events(job.tenant, job.id, after=0)[-1].number
        read = runtime.jobs.events

        def events(tenant: str, job_id: str, *, after: int, limit: int) -> list[JobEvent]:
            if when == "before":
                runtime.cancel(job_id)
            found = read(tenant, job_id, after=after, limit=limit)
            if when == "after":
                runtime.cancel(job_id)
            return found

        monkeypatch.setattr(runtime.jobs, "events", events)
        answer = await client.get(
            f"/v1/registrations/{job.id}/events", headers={"Last-Event-ID": str(first)}
        )
        assert '"cancelled"' in answer.text

    on_api(tmp_path, use)


def test_many_events_are_read_a_few_at_a_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MAX_EVENTS", 3)

    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        job = runtime.submit(new_job(tenant="default"))
        claimed = claim(runtime.transitions)
        for number in range(7):
            runtime.transitions.record_progress(claimed, "search", number / 10)
        runtime.cancel(job.id)
        number_of_events, sizes = 10, []
        read = runtime.jobs.events

        def events(*of: str, after: int, limit: int) -> list[JobEvent]:
            found = read(*of, after=after, limit=limit)
            sizes.append(len(found))
            return found

        monkeypatch.setattr(runtime.jobs, "events", events)
        answer = await client.get(f"/v1/registrations/{job.id}/events")
        assert answer.text.count("event: progress") == number_of_events
        assert sizes == [3, 3, 3, 1]

    on_api(tmp_path, use)
