"""A wait ends with the registration, whatever becomes of the streams."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import httpx
import pytest

from mpe_client import waiting
from mpe_client.errors import WaitTimeoutError
from mpe_client.models import Job, Progress
from mpe_client.transport import run_blocking
from tests.factories.fake_service import blocking_core, job

AT = "2026-01-05T09:30:00Z"


def event(number: int, status: str, stage: str, fraction: float) -> str:
    data = json.dumps({"at": AT, "status": status, "stage": stage, "fraction": fraction})
    return f"event: progress\ndata: {data}\nid: {number}\n\n: ping\n\n"


def stream(*events: str) -> httpx.Response:
    return httpx.Response(200, text="".join(events), headers={"Content-Type": "text/event-stream"})


class Service:
    """Streams one after the other; the registration has ended with the last one."""

    def __init__(self, *streams: httpx.Response | Exception) -> None:
        self.streams = list(streams)
        self.asked: list[str] = []
        self.polls: list[str | None] = []

    def __call__(self, request: httpx.Request) -> httpx.Response:
        if not request.url.path.endswith("/events"):
            self.polls.append(request.headers.get("Prefer"))
            return httpx.Response(200, json=job("running" if self.streams else "succeeded"))
        self.asked.append(request.headers["Last-Event-ID"])
        answer = self.streams.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return answer


@pytest.fixture(autouse=True)
def _no_pause(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(waiting, "POLL_PAUSE_S", 0.0)


def wait(
    service: Callable[[httpx.Request], httpx.Response], **kwargs: Any
) -> tuple[Job, list[Progress]]:
    seen: list[Progress] = []
    core = blocking_core(service)
    return run_blocking(core.wait("j1", seen.append, kwargs.get("timeout_s"))), seen


def test_progress_is_told_once_each() -> None:
    first = event(1, "queued", "queued", 0.0)
    service = Service(stream(first, first, event(2, "succeeded", "finished", 1.0)))
    ended, seen = wait(service)
    assert ended.status == "succeeded"
    assert [progress.stage for progress in seen][:2] == ["queued", "finished"]


def test_a_broken_stream_goes_on_after_the_last_event() -> None:
    broken = stream(event(7, "running", "search", 0.5))
    service = Service(broken, httpx.ReadError("gone"), stream(event(8, "succeeded", "finished", 1)))
    wait(service)
    assert service.asked == ["0", "7", "7"]


def test_where_no_stream_comes_through_the_client_polls() -> None:
    page = httpx.Response(200, text="<html>", headers={"Content-Type": "text/html"})
    service = Service(page, page)
    service.streams.append(page)  # one more that is never asked for

    def ended_at_third_poll(request: httpx.Request) -> httpx.Response:
        if len(service.polls) == 3:
            service.streams.clear()
        return service(request)

    ended, _ = wait(ended_at_third_poll)
    assert ended.status == "succeeded"
    assert len(service.asked) == waiting.MAX_SILENT_STREAMS
    assert service.polls[-1] == "wait=15"


def test_a_wait_has_a_limit_and_the_registration_goes_on() -> None:
    streams = [stream(event(1, "running", "search", 0.5)) for _ in range(100_000)]
    with pytest.raises(WaitTimeoutError, match="it goes on"):
        wait(Service(*streams), timeout_s=0.05)
