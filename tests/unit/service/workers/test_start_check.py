"""What keeps workers from starting is found before the service is started."""

from __future__ import annotations

import pytest

from service.workers import start_check as module
from service.workers.child import NoProcessError
from service.workers.start_check import find_start_failure
from tests.factories.attempts import FakeChild


class UnableChild(FakeChild):
    def wait_until_ready(self, timeout_s: float = 0.0) -> bool:
        raise NoProcessError("a library is missing")


@pytest.mark.parametrize(
    ("child", "expected"), [(FakeChild, None), (UnableChild, "a library is missing")]
)
def test_why_no_process_starts(
    monkeypatch: pytest.MonkeyPatch, child: type[FakeChild], expected: str | None
) -> None:
    calls: list[str] = []
    monkeypatch.setattr(module, "Child", child)
    monkeypatch.setattr(module, "prepare_forkserver", lambda threads: calls.append("prepared"))
    monkeypatch.setattr(module, "stop_forkserver", lambda: calls.append("stopped"))
    assert find_start_failure() == expected
    assert calls == ["prepared", "stopped"]
