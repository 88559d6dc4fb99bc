"""Both kinds of client submit once, wait, and cancel where they are told to."""

from __future__ import annotations

import asyncio
import io
import json
from collections.abc import Coroutine
from typing import Any

import httpx
import pytest

from mpe_client.core import Core
from mpe_client.errors import RegistrationCancelledError, RegistrationFailedError
from mpe_client.models import Job, Progress
from mpe_client.parameters import Submission
from mpe_client.transport import run_blocking
from tests.factories.fake_service import Handler, async_core, blocking_core, job

PROBLEM = {"type": "urn:mpe:problem:too-few-points", "title": "T", "status": 422, "detail": "D"}


class Service:
    """Takes a registration on the second try, and ends it as it is told to."""

    def __init__(self, end: dict[str, Any], *, refusals: int = 1) -> None:
        self.end, self.refusals = end, refusals
        self.submissions: list[tuple[str, bytes]] = []
        self.deleted = False

    def __call__(self, request: httpx.Request) -> httpx.Response:
        if request.method == "POST":
            self.submissions.append((request.headers["Idempotency-Key"], request.read()))
            if len(self.submissions) <= self.refusals:
                raise httpx.ReadError("the answer is lost")
            return httpx.Response(202, json=job("queued"))
        if request.method == "DELETE":
            self.deleted = True
            return httpx.Response(200, json=job("cancelled"))
        if request.url.path.endswith("/events"):
            return httpx.Response(404)
        return httpx.Response(200, json=job("queued") if self.end is None else self.end)


def blocking(handler: Handler, work: Any) -> Any:
    return run_blocking(work(blocking_core(handler)))


def on_loop(handler: Handler, work: Any) -> Any:
    return asyncio.run(work(async_core(handler)))


both = pytest.mark.parametrize("run", [blocking, on_loop])


def align(core: Core, **wanted: Any) -> Coroutine[Any, Any, Job]:
    source = io.BytesIO(b"1 2 3\n")
    return core.align(source, [[0, 0, 0]], Submission(**wanted), None, None, False)


@both
def test_a_repeated_submission_has_the_same_key_and_clouds(run: Any) -> None:
    service = Service(job())
    assert run(service, lambda core: align(core, seed=3, labels={"a": "b"})).status == "succeeded"
    (first, body), (second, again) = service.submissions
    assert first == second
    assert len(body) == len(again)
    assert b"1 2 3\n" in again
    assert b'{"seed": 3}' in again


@both
def test_a_failed_registration_is_raised_with_its_problem(run: Any) -> None:
    service = Service(job("failed", error=PROBLEM))
    with pytest.raises(RegistrationFailedError) as caught:
        run(service, align)
    assert caught.value.job.id == "j1"
    assert caught.value.problem.type == PROBLEM["type"]


@both
def test_a_cancelled_registration_is_raised(run: Any) -> None:
    with pytest.raises(RegistrationCancelledError):
        run(Service(job("cancelled")), align)


@pytest.mark.parametrize("is_wanted", [True, False])
@both
def test_an_interrupt_cancels_if_asked(run: Any, is_wanted: bool) -> None:
    service = Service(job("running"))

    def interrupt(_: Progress) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(
            service,
            lambda core: core.align([[0, 0, 0]], [[0, 0, 0]], {}, interrupt, None, is_wanted),
        )
    assert service.deleted == is_wanted


def test_a_cancelled_task_cancels_if_asked() -> None:
    service = Service(job("running"))

    async def cancel_soon() -> None:
        core = async_core(service)
        seen = asyncio.Event()
        task = asyncio.create_task(
            core.align([[0, 0, 0]], [[0, 0, 0]], {}, lambda _: seen.set(), None, True)
        )
        await seen.wait()
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    asyncio.run(cancel_soon())
    assert service.deleted


def test_references_alone_are_json() -> None:
    service = Service(job(), refusals=0)
    run_blocking(blocking_core(service).submit("https://host/a.ply", "s3://b/c", {"overlap": 0.5}))
    assert json.loads(service.submissions[0][1]) == {
        "options": {"overlap": 0.5},
        "source": {"url": "https://host/a.ply"},
        "target": {"url": "s3://b/c"},
    }
