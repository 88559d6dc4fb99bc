"""Few exports run at once, each ends in time, and none leaves anything behind."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from service.formats.errors import CloudFileError
from service.problems import (
    INTERNAL,
    ConnectionClosedError,
    JobMemoryError,
    JobTimeoutError,
    NotReadyError,
    OverloadedError,
    ServiceError,
    WorkerLostError,
    error_document,
    problem_document,
    problem_type,
)
from service.settings import Settings
from service.storage.blobs import BlobStore
from service.workers import exporter as module
from service.workers.aligned_pair import AlignedPair
from service.workers.child import ChildLostError, NoProcessError
from service.workers.export_aligned import ExportAligned
from service.workers.exporter import Exporter, ExportError
from service.workers.messages import Exported, Failed, Problem, Progress, Ready
from service.workers.task import TaskEnvironment
from tests.factories.attempts import FakeChild, Line
from tests.factories.jobs import new_job
from tests.factories.waiting import until

PROJECT = Path(__file__).parents[4]
IDENTITY = [[float(i == j) for j in range(4)] for i in range(4)]


class Children:
    """Starts children that all say the same lines."""

    def __init__(self, *lines: Line) -> None:
        self.lines = lines
        self.started: list[FakeChild] = []

    def __call__(self) -> FakeChild:
        self.started.append(FakeChild(*self.lines, files={"aligned.ply": b"ply"}))
        return self.started[-1]


class AnyBlob(BlobStore):
    """A store that has each blob that it is asked for."""

    def fetch(self, sha256: str) -> Path:
        return self.path(sha256)


@contextmanager
def exporter(
    data_dir: Path,
    monkeypatch: pytest.MonkeyPatch,
    *lines: Line,
    timeout_s: float = 60,
    **settings: object,
) -> Iterator[tuple[Exporter, Children]]:
    """An exporter whose children say the lines; checks that nothing is left in the end."""
    children = Children(*lines)
    monkeypatch.setattr(module, "Child", children)
    settings = {"job_timeout_s": timeout_s, "min_free_disk_bytes": 0} | settings
    yield Exporter(Settings(data_dir=data_dir, **settings), AnyBlob(data_dir)), children
    assert all(child.is_closed for child in children.started)
    assert list((data_dir / "scratch").iterdir()) == []


def export(made: Exporter, *, merged: bool = False) -> Path:
    job = new_job()

    def make_task(environment: TaskEnvironment) -> ExportAligned:
        pair = AlignedPair(IDENTITY, job.source, job.target, None)
        return ExportAligned(environment, pair, is_merged=merged, has_distances=False, format="ply")

    with made.export(job, make_task) as file:
        assert file.path.parent.exists()
        return file.path


@pytest.mark.parametrize("merged", [False, True])
def test_the_file_lasts_as_long_as_the_context(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, merged: bool
) -> None:
    with exporter(tmp_path, monkeypatch, Exported()) as (made, children):
        path = export(made, merged=merged)
        assert (path.name, path.parent.exists()) == ("aligned.ply", False)
        task = children.started[0].task
        assert isinstance(task, ExportAligned)
        assert (task.output, task.is_merged) == (path, merged)


def test_a_problem_of_the_child_is_that_of_the_export(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    document = error_document(CloudFileError("line 3: two numbers"))
    failed = Failed(Problem(**document), {})
    with exporter(tmp_path, monkeypatch, failed) as (made, _):
        with pytest.raises(ExportError, match="line 3") as raised:
            export(made)
        assert error_document(raised.value) == document
        assert problem_type(raised.value).status == 422


@pytest.mark.parametrize(
    "line", [ChildLostError("its process was ended by SIGKILL"), Ready(), Progress("decode", 0.1)]
)
def test_a_lost_child_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, line: Line) -> None:
    with (
        exporter(tmp_path, monkeypatch, line) as (made, _),
        pytest.raises(WorkerLostError, match="could not be written"),
    ):
        export(made)


def test_a_file_whose_process_was_killed_is_written_by_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with exporter(tmp_path, monkeypatch) as (made, children):
        lines: list[Line] = [ChildLostError("its process was ended by SIGKILL"), Exported()]

        def start() -> FakeChild:
            children.lines = (lines.pop(0),)
            return children()

        monkeypatch.setattr(module, "Child", start)
        assert export(made).name == "aligned.ply"
        assert len(children.started) == 2


def test_a_process_that_does_not_start_is_not_the_callers_fault(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    line = NoProcessError("a process ended before it was ready")
    with (
        exporter(tmp_path, monkeypatch, line) as (made, _),
        pytest.raises(NotReadyError, match="ended before it was ready"),
    ):
        export(made)


def test_a_child_that_the_kernel_ends_for_want_of_memory_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    counts = iter((3, 4))
    monkeypatch.setattr(module, "count_oom_kills", lambda: next(counts))
    line = ChildLostError("its process was ended by SIGKILL")
    with (
        exporter(tmp_path, monkeypatch, line) as (made, _),
        pytest.raises(JobMemoryError, match="MPE_WORKERS"),
    ):
        export(made)


def test_an_export_ends_when_its_caller_is_gone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    gone = threading.Event()
    gone.set()
    token = module.is_abandoned.set(gone)
    with (
        exporter(tmp_path, monkeypatch) as (made, children),
        pytest.raises(ConnectionClosedError, match="connection was closed"),
    ):
        export(made)
    module.is_abandoned.reset(token)
    assert len(children.started) == 1


def test_the_time_limit_ends_an_export(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with (
        exporter(tmp_path, monkeypatch, timeout_s=0.05) as (made, _),
        pytest.raises(JobTimeoutError, match=r"0\.05 s"),
    ):
        export(made)


def test_a_file_that_leaves_too_little_of_the_disk_is_given_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with (
        exporter(tmp_path, monkeypatch, min_free_disk_bytes=2**60) as (made, children),
        pytest.raises(OverloadedError, match="disk"),
    ):
        export(made)
    assert children.started[0].is_killed


def test_a_failure_of_a_library_on_a_full_disk_is_no_error_of_the_service(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """lazrs says "Failed to call seek"."""
    failed = Failed(Problem(**problem_document(INTERNAL, "The worker failed.")), {})
    with exporter(tmp_path, monkeypatch, failed) as (made, _):
        with pytest.raises(ExportError) as raised:
            export(made)
        assert problem_type(raised.value).status == 500
    with (
        exporter(tmp_path, monkeypatch, failed, min_free_disk_bytes=2**60) as (made, _),
        pytest.raises(OverloadedError, match="disk"),
    ):
        export(made)


class Waiting:
    """Exports in threads of their own, whose children are silent until they are let go."""

    def __init__(self, made: Exporter, children: Children, count: int) -> None:
        self.errors: list[BaseException] = []
        self.children = children
        self._made = made
        self._threads = [threading.Thread(target=self._export) for _ in range(count)]
        for thread in self._threads:
            thread.start()

    def _export(self) -> None:
        try:
            export(self._made)
        except ServiceError as error:
            self.errors.append(error)

    def join(self) -> None:
        for thread in self._threads:
            thread.join(timeout=30)
            assert not thread.is_alive()


def test_few_run_at_once_and_the_others_wait(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    count, go = module.MAX_RUNNING + 3, threading.Event()

    def hold() -> None:
        assert go.wait(30)

    with exporter(tmp_path, monkeypatch, hold, Exported()) as (made, children):
        waiting = Waiting(made, children, count)
        until(lambda: len(children.started) == module.MAX_RUNNING)
        time.sleep(0.05)
        assert len(children.started) == module.MAX_RUNNING
        go.set()
        waiting.join()
        assert waiting.errors == []
        assert len(children.started) == count


def test_more_than_may_wait_are_refused_with_a_time_to_return(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with exporter(tmp_path, monkeypatch) as (made, children):
        waiting = Waiting(made, children, module.MAX_RUNNING + module.MAX_WAITING)
        until(lambda: made._waiting == module.MAX_WAITING)
        with pytest.raises(OverloadedError) as refused:
            export(made)
        assert refused.value.headers["Retry-After"]
        made.stop()
        waiting.join()


def test_stopping_kills_what_runs_and_refuses_what_waits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with exporter(tmp_path, monkeypatch) as (made, children):
        waiting = Waiting(made, children, module.MAX_RUNNING + 1)
        until(lambda: len(children.started) == module.MAX_RUNNING and made._waiting == 1)
        made.stop()
        waiting.join()
        assert [type(error) for error in waiting.errors] == [NotReadyError] * 3
        with pytest.raises(NotReadyError):
            export(made)


IN_THE_SANDBOX = """
import json, sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from service.formats import read_points
from service.clouds.inputs import CloudInput
from service.settings import Settings
from service.storage.blobs import BlobStore
from service.workers.child import prepare_forkserver
from service.workers.aligned_pair import AlignedPair
from service.workers.export_aligned import ExportAligned
from service.workers.exporter import ExportError, Exporter
from tests.factories.cloud_files import POINTS, ply
from tests.factories.jobs import new_job

data_dir = Path(sys.argv[1])
blobs = BlobStore(data_dir)

def cloud(content):
    blob = blobs.put([content])
    return CloudInput(sha256=blob.sha256, size=blob.size)

prepare_forkserver(1)
settings = Settings(data_dir=data_dir, job_timeout_s=100, job_memory_bytes=2 << 30)
exporter = Exporter(settings, blobs)
job = new_job(source=cloud(ply()), target=cloud(b"1 2 3\\n4 5 6\\n7 8 9\\n"))
T = np.eye(4)
T[:3, 3] = 1, 2, 3

def aligned(job, merged):
    return exporter.export(job, lambda environment: ExportAligned(
        environment, AlignedPair(T.tolist(), job.source, job.target, None), merged, True, "pcd"))

for merged in (False, True):
    with aligned(job, merged) as file:
        exported = read_points(file.path, attributes=True)
        assert np.allclose(exported.points[: len(POINTS)], POINTS + T[:3, 3], atol=1e-4)
        assert np.isfinite(exported.attributes["distance"][: len(POINTS)]).all()
        print(len(exported.points) - len(POINTS), "red" in exported.attributes)
broken = replace(job, source=cloud(b"ply\\nformat ascii 1.0\\nelement vertex 5\\n"))
try:
    with aligned(broken, False):
        pass
except ExportError as error:
    print(error.problem.status, error.problem.slug)
print(list((data_dir / "scratch").iterdir()))
"""


@pytest.mark.slow
def test_the_file_is_written_in_the_sandbox(tmp_path: Path) -> None:
    program = [sys.executable, "-c", IN_THE_SANDBOX, str(tmp_path)]
    done: subprocess.CompletedProcess[Any] = subprocess.run(
        program, cwd=PROJECT, capture_output=True, text=True
    )
    assert done.stdout.splitlines() == ["0 True", "3 False", "422 unreadable-cloud", "[]"], (
        done.stderr
    )
