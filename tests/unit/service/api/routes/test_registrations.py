"""Registrations over HTTP: accepted, waited for, listed in pages, cancelled, deleted."""

from __future__ import annotations

import asyncio
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import pytest

from service.api.threads import THREADS, limit_threads
from service.auth.keys import DEFAULT_TENANT
from service.jobs.model import JobRow
from service.jobs.queries import JobFilter, JobQueries
from service.runtime import Runtime
from tests.factories.api import XYZ, IdleWorkers, on_api
from tests.factories.jobs import LEASE_S, OUTCOME, claim, new_job

FILES = {"source": ("a", XYZ), "target": ("b", XYZ)}
PATH = "/v1/registrations"


def submitted(runtime: Runtime, **values: Any) -> JobRow:
    return runtime.submit(new_job(tenant=DEFAULT_TENANT, **values))


def succeeded(runtime: Runtime, **values: Any) -> JobRow:
    submitted(runtime, **values)
    job = claim(runtime.transitions)
    blob = runtime.blobs.put([b"{}"])
    outcome = replace(OUTCOME, result_sha256=blob.sha256, inliers_sha256=blob.sha256)
    runtime.transitions.succeed(job, outcome, work_key=None)
    return job


def test_a_submission_is_accepted(tmp_path: Path) -> None:
    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        response = await client.post(PATH, files=FILES, data={"labels": '{"part": "door"}'})
        job = response.json()
        assert response.status_code == 202
        assert response.headers["Location"] == f"{PATH}/{job['id']}"
        assert response.headers["Retry-After"] == "1"
        assert "Preference-Applied" not in response.headers
        assert (job["status"], job["labels"], job["result"]) == ("queued", {"part": "door"}, None)
        assert (await client.get(response.headers["Location"])).json() == job

    on_api(tmp_path, use)


@pytest.mark.parametrize(
    ("prefer", "applied"),
    [
        ("wait=0", "wait=0"),
        ('respond-async, WAIT="0"', "wait=0"),
        ("wait=0;x", "wait=0"),
        ("wait=9", "wait=0"),
        ("await=9", None),
        ("wait=-1", None),
        ("wait=", None),
    ],
)
def test_the_preferred_wait(tmp_path: Path, prefer: str, applied: str | None) -> None:
    """Never longer than MPE_MAX_WAIT_S; what is no number of seconds is ignored."""

    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        response = await client.post(PATH, files=FILES, headers={"Prefer": prefer})
        assert response.status_code == 202
        assert response.headers.get("Preference-Applied") == applied

    on_api(tmp_path, use, max_wait_s=0.01)


def test_the_same_idempotency_key_gives_the_same_registration(tmp_path: Path) -> None:
    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        headers = {"Idempotency-Key": "scan-7"}
        first = await client.post(PATH, files=FILES, headers=headers)
        again = await client.post(PATH, files=FILES, headers=headers)
        other = await client.post(PATH, files=FILES, headers=headers, data={"priority": "1"})
        assert first.json()["id"] == again.json()["id"]
        assert other.status_code == 422
        assert other.json()["type"] == "urn:mpe:problem:idempotency-mismatch"

    on_api(tmp_path, use)


def test_input_that_failed_within_the_wait_is_a_problem(tmp_path: Path) -> None:
    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        error = {"type": "urn:mpe:problem:t", "title": "T", "status": 422, "detail": "d"}

        async def fail() -> None:
            while (job := runtime.transitions.claim("register", lease_s=LEASE_S)) is None:
                await asyncio.sleep(0.02)
            runtime.transitions.fail(job, error, {})

        async with asyncio.TaskGroup() as group:
            group.create_task(fail())
            response = await client.post(PATH, files=FILES, headers={"Prefer": "wait=60"})
        assert response.status_code == 422
        assert response.headers["Content-Type"] == "application/problem+json"
        job_id = response.headers["Location"].rpartition("/")[2]
        assert response.json() == error | {"job": job_id}

    on_api(tmp_path, use)


def test_pages_follow_one_another(tmp_path: Path) -> None:
    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        jobs = [submitted(runtime, created_at=1000.0 + i // 2) for i in range(5)]
        found: list[str] = []
        query: dict[str, Any] = {"limit": 2}
        for left in (3, 1, 0):
            page = (await client.get(PATH, params=query)).json()
            found += [job["id"] for job in page["items"]]
            assert (page["next_cursor"] is None) == (left == 0)
            query["cursor"] = page["next_cursor"]
        assert sorted(found) == sorted(job.id for job in jobs)

    on_api(tmp_path, use)


@pytest.mark.parametrize(
    ("query", "expected"),
    [
        ({}, ["new", "old"]),
        ({"label": "part:door"}, ["new"]),
        ({"status": "running"}, []),
        ({"search": "DOOR ne"}, ["new"]),
        ({"search": ""}, ["new", "old"]),
        ({"search": "door roof"}, []),
        ({"created_after": "1970-01-01T00:20:00Z"}, ["new"]),
        ({"created_before": "1970-01-01T00:20:00"}, ["old"]),
        ({"created_before": "1970-01-01T02:20:00+02:00"}, ["old"]),
    ],
)
def test_filters(tmp_path: Path, query: dict[str, str], expected: list[str]) -> None:
    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        submitted(runtime, created_at=1000.0, labels={"name": "old", "part": "roof"})
        submitted(runtime, created_at=2000.0, labels={"name": "new", "part": "door"})
        submitted(runtime, created_at=3000.0)
        runtime.submit(new_job(tenant="other", labels={"part": "door"}))
        page = (await client.get(PATH, params=query)).json()
        names = [job["labels"].get("name") for job in page["items"]]
        assert [name for name in names if name] == expected

    on_api(tmp_path, use)


@pytest.mark.parametrize(
    "query",
    [
        {"limit": 0},
        {"limit": 201},
        {"cursor": "x"},
        {"created_after": "1000"},
        {"label": "x"},
        {"search": "x" * 201},
        {"search": "a b c d e f g h i j k"},
    ],
)
def test_queries_that_make_no_sense(tmp_path: Path, query: dict[str, Any]) -> None:
    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        response = await client.get(PATH, params=query)
        assert response.status_code == 422
        assert response.json()["type"] == "urn:mpe:problem:invalid-request"
        (name,) = query
        assert response.json()["errors"][0]["pointer"] == f"/query/{name}"

    on_api(tmp_path, use)


def test_what_waits_is_cancelled_and_what_has_ended_is_deleted(tmp_path: Path) -> None:
    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        job = submitted(runtime)
        cancelled = await client.delete(f"{PATH}/{job.id}")
        assert (cancelled.status_code, cancelled.json()["status"]) == (200, "cancelled")
        assert isinstance(runtime.workers, IdleWorkers)
        assert runtime.workers.killed == [job.id]
        assert (await client.delete(f"{PATH}/{job.id}")).status_code == 204
        assert runtime.workers.killed == [job.id]
        for method in ("GET", "DELETE"):
            gone = await client.request(method, f"{PATH}/{job.id}")
            assert gone.json()["type"] == "urn:mpe:problem:unknown-registration"

    on_api(tmp_path, use)


def test_a_result_comes_with_its_job(tmp_path: Path) -> None:
    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        job = succeeded(runtime)
        response = await client.get(f"{PATH}/{job.id}")
        assert (response.json()["status"], response.json()["result"]) == ("succeeded", {})
        assert "Retry-After" not in response.headers

    on_api(tmp_path, use)


def test_another_tenants_registration_is_unknown(tmp_path: Path) -> None:
    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        job = runtime.submit(new_job(tenant="other"))
        for path in ("", "/events", "/inliers", "/aligned", "/deliveries"):
            response = await client.get(f"{PATH}/{job.id}{path}")
            assert response.status_code == 404
        assert (await client.delete(f"{PATH}/{job.id}")).status_code == 404

    on_api(tmp_path, use)


def test_events_end_with_the_registration(tmp_path: Path) -> None:
    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        job = succeeded(runtime)
        text = (await client.get(f"{PATH}/{job.id}/events")).text
        assert [line for line in text.splitlines() if line.startswith("id:")] == [
            "id: 1",
            "id: 2",
            "id: 3",
        ]
        later = await client.get(f"{PATH}/{job.id}/events", headers={"Last-Event-ID": "2"})
        assert later.text.count("id:") == 1
        assert '"status":"succeeded"' in later.text

    on_api(tmp_path, use)


def test_a_key_answers_while_its_first_request_still_waits(tmp_path: Path) -> None:
    """The first connection was cut, perhaps; whoever repeats the request does not wait for it."""

    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        headers = {"Idempotency-Key": "k"}
        waiting = asyncio.create_task(
            client.post(PATH, files=FILES, headers=headers | {"Prefer": "wait=60"})
        )
        while not (rows := runtime.jobs.page("default", limit=1)):
            await asyncio.sleep(0.01)
        for _ in range(50):
            again = await client.post(PATH, files=FILES, headers=headers)
            if again.status_code != 409:
                break
            await asyncio.sleep(0.05)
        assert (again.status_code, again.json()["id"]) == (202, rows[0].id)
        assert not waiting.done()
        runtime.cancel(rows[0].id)
        assert (await waiting).json()["id"] == rows[0].id

    on_api(tmp_path, use)


def test_slow_searches_hold_up_no_other_call(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However many there are: they look at each registration of a tenant, and have own threads."""

    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        limit_threads(waits_for_others=False)
        is_over = threading.Event()
        look = type(runtime.jobs).page

        def slow(jobs: JobQueries, tenant: str, *, only: JobFilter, **page: Any) -> list[JobRow]:
            if only.words:
                is_over.wait(20)
            return look(jobs, tenant, only=only, **page)

        monkeypatch.setattr(type(runtime.jobs), "page", slow)
        searches = [client.get(PATH, params={"search": "door"}) for _ in range(3 * THREADS)]
        waiting = asyncio.gather(*searches)
        await asyncio.sleep(0.1)
        async with asyncio.timeout(10):
            assert (await client.get(PATH)).status_code == 200
            assert (await client.get("/v1/capacity")).status_code == 200
        is_over.set()
        assert {answer.status_code for answer in await waiting} == {200}

    on_api(tmp_path, use)
