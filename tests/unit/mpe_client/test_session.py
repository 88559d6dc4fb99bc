"""Requests are sent again where that is safe, and no longer than the patience."""

from __future__ import annotations

import httpx
import pytest

from mpe_client.errors import ProblemError, UnreachableError
from mpe_client.retry import Patience, Tries, asked_pause
from mpe_client.transport import run_blocking
from tests.factories.fake_service import blocking_core, job, problem


class Service:
    """Answers one after the other; the last one again and again."""

    def __init__(self, *answers: httpx.Response | Exception) -> None:
        self.answers, self.requests = list(answers), 0

    def __call__(self, request: httpx.Request) -> httpx.Response:
        self.requests += 1
        answer = self.answers.pop(0) if len(self.answers) > 1 else self.answers[0]
        if isinstance(answer, Exception):
            raise answer
        return answer


GOOD = httpx.Response(200, json=job())


@pytest.mark.parametrize(
    "passing",
    [
        httpx.ConnectError("refused"),
        httpx.ReadError("reset"),
        httpx.ReadTimeout("late"),
        httpx.RemoteProtocolError("gone"),
        httpx.Response(502, text="<html>bad gateway</html>"),
        problem(503, "not-ready", **{"Retry-After": "0"}),
        problem(429, "rate-limited", **{"Retry-After": "0"}),
        problem(409, "idempotency-in-flight", **{"Retry-After": "0"}),
    ],
    ids=repr,
)
def test_what_passes_is_tried_again(passing: httpx.Response | Exception) -> None:
    service = Service(passing, passing, GOOD)
    assert run_blocking(blocking_core(service).get("j1")).id == "j1"
    assert service.requests == 3


@pytest.mark.parametrize(
    ("status", "name"), [(401, "unauthorized"), (404, "unknown-registration"), (504, "job-timeout")]
)
def test_what_does_not_pass_is_raised_with_its_problem(status: int, name: str) -> None:
    service = Service(problem(status, name))
    with pytest.raises(ProblemError, match=rf"\({status}\): Do this\.") as caught:
        run_blocking(blocking_core(service).get("j1"))
    assert caught.value.problem.type == f"urn:mpe:problem:{name}"
    assert service.requests == 1


def test_a_refusal_without_a_document_is_a_problem_too() -> None:
    service = Service(httpx.Response(404, text="<h1>no such page</h1>"))
    with pytest.raises(ProblemError, match="no such page") as caught:
        run_blocking(blocking_core(service).get("j1"))
    assert caught.value.problem.status == 404


def test_the_patience_ends() -> None:
    service = Service(httpx.ConnectError("refused"))
    core = blocking_core(service, Patience(max_s=0.05, first_s=0.001, most_s=0.01))
    with pytest.raises(UnreachableError, match="http://service"):
        run_blocking(core.get("j1"))
    assert service.requests > 2


def test_a_longer_pause_than_the_patience_is_not_begun() -> None:
    service = Service(problem(503, "overloaded", **{"Retry-After": "3600"}))
    with pytest.raises(ProblemError, match="503"):
        run_blocking(blocking_core(service).get("j1"))
    assert service.requests == 1


def test_pauses_grow_up_to_a_bound() -> None:
    tries = Tries(Patience(max_s=1e6, first_s=1.0, most_s=8.0))
    pauses = [tries.next_pause() or 0.0 for _ in range(6)]
    for pause, longest in zip(pauses, (1, 2, 4, 8, 8, 8), strict=True):
        assert longest / 2 <= pause <= longest
    assert (tries.next_pause(asked_s=100.0) or 0.0) >= 100.0


def test_success_asks_for_no_pause() -> None:
    assert asked_pause(httpx.Response(202, headers={"Retry-After": "1"})) is None
