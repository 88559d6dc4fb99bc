"""Whatever a task does, its child answers with a valid message."""

from __future__ import annotations

import errno
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from service.formats import CloudFileError
from service.outbound.errors import FetchError
from service.workers.child_main import answer_task
from service.workers.messages import Answer, Exported, Failed, decode, encode
from service.workers.progress import ProgressReport
from service.workers.sandbox.limits import ResourceLimits
from service.workers.task import Task, TaskEnvironment

LIMITS = ResourceLimits(memory_bytes=300 * 2**20, cpu_s=1)
ENVIRONMENT = TaskEnvironment("job", "lab", Path("data"), Path("scratch"), 1, LIMITS, 0, False)


@dataclass(frozen=True, slots=True)
class Call(Task):
    """Calls the function as its work."""

    call: Callable[[ProgressReport], Answer]

    @property
    def readable(self) -> list[Path]:
        return []

    def perform(self, report: ProgressReport) -> Answer:
        return self.call(report)


def answer(call: Callable[[ProgressReport], Answer]) -> Answer:
    """What the parent receives."""
    message = decode(encode(answer_task(Call(ENVIRONMENT, call), ProgressReport(lambda _: None))))
    assert isinstance(message, Answer)
    return message


def failure(error: BaseException) -> Failed:
    def fail(report: ProgressReport) -> Answer:
        with report.stage("decode"):
            raise error

    failed = answer(fail)
    assert isinstance(failed, Failed)
    assert list(failed.timing) == ["decode_s"]
    return failed


def test_an_answer_is_sent_as_it_is() -> None:
    assert answer(lambda report: Exported()) == Exported()


@pytest.mark.parametrize(
    ("error", "kind", "status"),
    [
        (CloudFileError("source: line 3: two numbers"), "unreadable-cloud", 422),
        (FetchError("source: the server answered 404"), "fetch-failed", 422),
    ],
)
def test_a_foreseen_error_keeps_its_type_and_text(error: Exception, kind: str, status: int) -> None:
    problem = failure(error).problem
    assert problem.type == f"urn:mpe:problem:{kind}"
    assert (problem.status, problem.detail) == (status, str(error))


@pytest.mark.parametrize("error", [MemoryError(), OSError(errno.ENOMEM, "no map")], ids=repr)
def test_a_lack_of_memory_names_the_limit(error: Exception) -> None:
    problem = failure(error).problem
    assert problem.type == "urn:mpe:problem:job-memory"
    assert "300 MiB" in problem.detail


def test_an_unforeseen_error_is_logged_and_not_shown(caplog: pytest.LogCaptureFixture) -> None:
    problem = failure(RuntimeError("secret")).problem
    assert problem.type == "urn:mpe:problem:internal-error"
    assert "secret" not in problem.detail
    assert "secret" in caplog.text


@pytest.mark.parametrize("text", ["x" * 10**6, "\ud800", "a\nb\x00c"])
def test_any_text_of_an_error_can_be_sent(text: str) -> None:
    failure(CloudFileError(text))
