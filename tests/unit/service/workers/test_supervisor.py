"""Whatever a child does, its attempt ends as it should, and the child with it."""

from __future__ import annotations

import errno
import hashlib
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, cast

import pytest

from service.clouds.inputs import CloudInput
from service.database.engine import Database, open_database
from service.jobs.model import JobQueue, JobRow
from service.jobs.queries import JobQueries
from service.jobs.transitions import MAX_LOST_ATTEMPTS, JobTransitions
from service.jobs.worker_slots import WorkerSlots
from service.problems import INTERNAL, NotReadyError, error_document, problem_document
from service.settings import Settings
from service.storage.blobs import BlobStore
from service.workers import supervisor as module
from service.workers.child import Child, ChildLostError, ChildMemoryError
from service.workers.fetch_inputs import FetchInputs
from service.workers.messages import (
    Exported,
    Failed,
    Fetched,
    FetchedFile,
    Problem,
    Progress,
    Succeeded,
)
from service.workers.register_clouds import INLIERS_NAME, RESULT_NAME, RegisterClouds
from service.workers.spare import SpareChild
from service.workers.supervisor import AttemptSupervisor
from tests.factories.attempts import FakeChild, FakeSpare, Line, result_files
from tests.factories.jobs import TENANT, add, claim, open_transitions

HERE = CloudInput(sha256="cd" * 32, size=3)
AWAY = CloudInput(url="http://there/cloud.ply")
SUCCEEDED = Succeeded(0.9, ["odd"], {"decode_s": 1.0})
FETCHED = FetchedFile("ab" * 32, '"1"', None, is_cached=False)
FILES = {"source": b"cloud", "target": b"cloud", **result_files()}
FAILED = Failed(Problem("urn:mpe:problem:cloud-shape", "No cloud", 422, "too flat"), {"d_s": 1.0})


@dataclass
class Attempts:
    """A store with one job, and a supervisor whose children say what the test wants."""

    database: Database
    jobs: JobQueries
    transitions: JobTransitions
    blobs: BlobStore
    settings: Settings
    children: list[FakeChild] = field(default_factory=list)
    started: list[Child] = field(default_factory=list)
    fetched: int = 0

    def add(self, **values: Any) -> JobRow:
        return add(self.transitions, **{"source": HERE, "target": HERE} | values)

    def limit(self, seconds: float) -> None:
        self.settings = self.settings.model_copy(update={"job_timeout_s": seconds})

    def run(self, *children: list[Line]) -> JobRow:
        """Run an attempt at the next job with one child after the other; return the job then."""
        return self.supervise([FakeChild(*lines, files=FILES) for lines in children])

    def fetch(self, *lines: Line) -> JobRow:
        """Run an attempt at fetching the clouds of the next job; return the job then."""
        return self.supervise([FakeChild(*lines, files=FILES)], "fetch")

    def _count_fetched(self) -> None:
        self.fetched += 1

    def supervise(self, children: list[FakeChild], queue: JobQueue = "register") -> JobRow:
        job, self.children = claim(self.transitions, queue), children
        AttemptSupervisor(
            self.transitions,
            self.blobs,
            self.settings,
            started=lambda job, child: self.started.append(child),
            fetched=self._count_fetched,
            spare=cast(SpareChild, FakeSpare(children)),
        ).run_attempt(job)
        assert all(child.is_closed for child in children if child.task is not None)
        assert list((self.settings.data_dir / "scratch").iterdir()) == []
        return self.now(job)

    def now(self, job: JobRow) -> JobRow:
        found = self.jobs.get(TENANT, job.id)
        assert found is not None
        return found


@pytest.fixture
def attempts(tmp_path: Path) -> Iterator[Attempts]:
    database = open_database(f"sqlite:///{tmp_path / 'jobs.sqlite3'}")
    settings = Settings(data_dir=tmp_path, job_timeout_s=60)
    transitions, blobs = open_transitions(database), BlobStore(tmp_path)
    assert HERE.sha256 is not None
    blobs.path(HERE.sha256).parent.mkdir()
    blobs.path(HERE.sha256).write_bytes(b"1 2")
    yield Attempts(database, JobQueries(database), transitions, blobs, settings)
    database.close()


@pytest.fixture(autouse=True)
def _short_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "POLL_INTERVAL_S", 0.01)


def test_success_is_recorded_with_what_the_child_stored(attempts: Attempts) -> None:
    attempts.add()
    job = attempts.run([Progress("decode", 0.05), Progress("search", 0.4), SUCCEEDED])
    assert job.status == "succeeded"
    stored = [attempts.blobs.path(str(name)) for name in (job.result_sha256, job.inliers_sha256)]
    assert [path.read_bytes() for path in stored] == [FILES[RESULT_NAME], FILES[INLIERS_NAME]]
    assert job.result_bytes == sum(path.stat().st_size for path in stored)
    assert (job.confidence, job.warnings) == (0.9, ["odd"])
    assert {"queued_s", "decode_s", "total_s"} <= set(job.timing)
    stages = [event.stage for event in attempts.jobs.events(TENANT, job.id, after=0)]
    assert stages == ["queued", "queued", "decode", "search", "finished"]
    task = attempts.children[0].task
    assert isinstance(task, RegisterClouds)
    assert (task.source, task.options) == (HERE, {"seed": 1})


def test_inputs_are_fetched_by_a_child_of_their_own(attempts: Attempts) -> None:
    attempts.add(source=AWAY)
    waits = attempts.fetch(Progress("fetch", 0.0), Fetched(FETCHED, None, {"fetch_s": 2.0}))
    assert (waits.status, waits.queue, attempts.fetched) == ("queued", "register", 1)
    (fetch,) = attempts.children
    job = attempts.run([SUCCEEDED])
    (register,) = attempts.children
    sha256 = hashlib.sha256(b"cloud").hexdigest()
    assert (job.status, job.attempt) == ("succeeded", 1)
    assert (job.source.sha256, job.source.size, job.source.url) == (sha256, 5, AWAY.url)
    assert job.target == HERE
    assert (job.timing["fetch_s"], job.timing["decode_s"]) == (2.0, 1.0)
    assert isinstance(fetch.task, FetchInputs)
    assert isinstance(register.task, RegisterClouds)
    assert register.task.source.sha256 == sha256
    assert attempts.blobs.path(sha256).read_bytes() == b"cloud"


def test_a_problem_is_recorded_as_it_is(attempts: Attempts) -> None:
    attempts.add()
    job = attempts.run([FAILED])
    assert (job.status, job.lost_attempts) == ("failed", 0)
    assert job.error == {
        "type": "urn:mpe:problem:cloud-shape",
        "title": "No cloud",
        "status": 422,
        "detail": "too flat",
    }
    assert job.timing["d_s"] == 1.0


def test_what_cannot_be_fetched_is_not_registered(attempts: Attempts) -> None:
    attempts.add(source=AWAY)
    assert attempts.fetch(FAILED).status == "failed"
    assert attempts.fetched == 0


@pytest.mark.parametrize(
    "last",
    [
        ChildLostError("its process was ended by SIGKILL"),
        ChildLostError("it sent an invalid message (json_invalid)"),
        Exported(),
        Fetched(None, None, {}),
    ],
    ids=["killed", "nonsense", "answer to an export", "answer to a fetch"],
)
def test_a_lost_child_is_tried_again_and_fails_the_job_in_the_end(
    attempts: Attempts, last: Line
) -> None:
    attempts.add()
    for lost in range(1, MAX_LOST_ATTEMPTS):
        job = attempts.run([Progress("decode", 0.05), last])
        assert (job.status, job.lost_attempts, job.attempt) == ("queued", lost, lost)
    job = attempts.run([last])
    assert job.status == "failed"
    assert job.error is not None
    assert job.error["type"] == "urn:mpe:problem:worker-lost"


@pytest.mark.parametrize(
    "last",
    [
        Failed(Problem(**error_document(OSError(errno.ENOSPC, "no space"))), {}),
        OSError(errno.ENOSPC, "no space"),
    ],
    ids=["in the child", "in the service"],
)
def test_a_full_disk_costs_the_job_nothing_and_it_is_tried_again(
    attempts: Attempts, last: Line
) -> None:
    attempts.add()
    for number in range(1, 4):
        job = attempts.run([Progress("decode", 0.05), last])
        assert (job.status, job.lost_attempts, job.interruptions) == ("queued", 0, number)
    assert attempts.run([SUCCEEDED]).status == "succeeded"


def test_an_unexplained_failure_on_a_full_disk_is_that_of_the_disk(attempts: Attempts) -> None:
    attempts.add()
    unexplained = Failed(Problem(**problem_document(INTERNAL, "It was logged.")), {})
    settings = attempts.settings
    attempts.settings = settings.model_copy(update={"min_free_disk_bytes": 2**60})
    job = attempts.run([unexplained])
    assert (job.status, job.interruptions) == ("queued", 1)
    attempts.settings = settings
    job = attempts.run([unexplained])
    assert job.status == "failed"
    assert job.error is not None
    assert job.error["type"] == "urn:mpe:problem:internal-error"


@pytest.mark.parametrize("queue", ["fetch", "register"])
def test_a_child_that_leaves_too_little_of_the_disk_is_ended_and_the_job_tried_again(
    attempts: Attempts, queue: JobQueue
) -> None:
    attempts.add(source=AWAY if queue == "fetch" else HERE)
    attempts.settings = attempts.settings.model_copy(update={"min_free_disk_bytes": 2**60})
    written = {"cloud": bytes(module.SMALL_SCRATCH_BYTES + 1)}
    job = attempts.supervise([FakeChild(files=written)], queue)
    assert (job.status, job.queue) == ("queued", queue)
    assert (job.lost_attempts, job.interruptions) == (0, 1)


def test_a_job_goes_on_where_others_have_filled_the_disk(attempts: Attempts) -> None:
    attempts.add()
    attempts.settings = attempts.settings.model_copy(update={"min_free_disk_bytes": 2**60})
    assert attempts.run([Progress("decode", 0.05), SUCCEEDED]).status == "succeeded"


def test_a_missing_input_is_told_as_such(attempts: Attempts) -> None:
    attempts.add(target=CloudInput(sha256="00" * 32, size=3))
    job = attempts.run([])
    assert job.status == "failed"
    assert job.error is not None
    assert (job.error["status"], job.error["type"]) == (410, "urn:mpe:problem:expired")
    assert job.error["detail"].startswith("target: ")


def test_a_child_that_gets_no_more_memory_is_not_tried_again(attempts: Attempts) -> None:
    attempts.add()
    job = attempts.run([ChildMemoryError("its process ended with code 127")])
    assert job.status == "failed"
    assert job.error is not None
    assert job.error["type"] == "urn:mpe:problem:job-memory"
    assert "MPE_JOB_MEMORY_BYTES" in job.error["detail"]


def test_a_job_that_the_kernel_ends_for_want_of_memory_says_so(
    attempts: Attempts, monkeypatch: pytest.MonkeyPatch
) -> None:
    counts = iter((3, 4))
    monkeypatch.setattr(module, "count_oom_kills", lambda: next(counts))
    attempts.add()
    job = attempts.run([ChildLostError("its process was ended by SIGKILL")])
    assert job.status == "failed"
    assert job.error is not None
    assert job.error["type"] == "urn:mpe:problem:job-memory"
    assert "MPE_WORKERS" in job.error["detail"]


@pytest.mark.parametrize("labels", [(), ("large",)])
def test_a_job_without_memory_goes_to_a_larger_worker_unless_it_was_on_one(
    attempts: Attempts, labels: tuple[str, ...]
) -> None:
    attempts.settings = attempts.settings.model_copy(update={"worker_labels": labels})
    WorkerSlots(attempts.database, 1, ["large"]).announce()
    attempts.add()
    job = attempts.run([Failed(Problem(module.JOB_MEMORY, "Memory", 507, "too much"), {})])
    expected = ("failed", "register") if labels else ("queued", "large")
    assert (job.status, job.queue) == expected


def test_a_fetch_that_leaves_out_a_file_is_a_lost_child(attempts: Attempts) -> None:
    attempts.add(source=AWAY)
    assert attempts.fetch(Fetched(None, None, {})).lost_attempts == 1


@pytest.mark.parametrize(
    "files",
    [
        {},
        FILES | {RESULT_NAME: b"{}"},
        FILES | {INLIERS_NAME: FILES[INLIERS_NAME][:-1]},
        *(
            FILES | {RESULT_NAME: FILES[RESULT_NAME].replace(b"[[0,0],[1,1]]", pairs)}
            for pairs in (b'[[0,0],"x"]]', b"[[0,0]]", b"[[0,0],[1,1],[1,1]]", b"[[0,0],[1,1]")
        ),
    ],
)
def test_a_result_that_is_not_valid_is_a_lost_child(
    attempts: Attempts, files: dict[str, bytes]
) -> None:
    attempts.add()
    job = attempts.supervise([FakeChild(SUCCEEDED, files=files)])
    assert (job.status, job.lost_attempts) == ("queued", 1)


def test_a_fetch_that_claims_a_file_that_is_not_cached_is_a_lost_child(attempts: Attempts) -> None:
    """The child cannot name a stored file; only the tenant's cache can."""
    attempts.add(source=AWAY)
    claimed = replace(FETCHED, is_cached=True)
    assert attempts.fetch(Fetched(claimed, None, {})).lost_attempts == 1


def test_a_child_that_cannot_be_started_costs_the_job_nothing(attempts: Attempts) -> None:
    attempts.add()
    job = attempts.run()
    assert (job.status, job.lost_attempts, job.interruptions) == ("queued", 0, 1)


def test_the_time_limit_ends_a_silent_child(attempts: Attempts) -> None:
    attempts.limit(0.05)
    attempts.add()
    job = attempts.run([])
    assert job.error is not None
    assert job.error["type"] == "urn:mpe:problem:job-timeout"
    assert "0.05 s" in job.error["detail"]


def test_the_time_limit_ends_a_child_that_talks_without_end(attempts: Attempts) -> None:
    attempts.limit(0.1)
    attempts.add()
    job = attempts.run([Progress("decode", 0.1), lambda: time.sleep(0.2), Progress("decode", 0.2)])
    assert job.error is not None
    assert job.error["type"] == "urn:mpe:problem:job-timeout"


def test_a_child_that_talks_without_end_fills_no_table(
    attempts: Attempts, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "FREE_PROGRESS", 5)
    monkeypatch.setattr(module, "PROGRESS_PER_S", 0)
    attempts.add()
    job = attempts.run([*(Progress(f"s{i}", 0.1) for i in range(50)), SUCCEEDED])
    assert job.status == "succeeded"
    assert len(list(attempts.jobs.events(TENANT, job.id, after=0))) == 2 + 5 + 1


def test_the_deadline_ends_an_attempt(attempts: Attempts) -> None:
    attempts.add(deadline_at=time.time() + 0.05)
    job = attempts.run([])
    assert job.error is not None
    assert job.error["type"] == "urn:mpe:problem:deadline-passed"


def test_a_job_that_is_cancelled_meanwhile_stays_cancelled(attempts: Attempts) -> None:
    job = attempts.add()
    ended = attempts.run([lambda: attempts.transitions.cancel(job.id)])
    assert ended.status == "cancelled"
    (child,) = attempts.children
    assert child.is_killed


def test_an_answer_after_the_cancel_changes_nothing(attempts: Attempts) -> None:
    job = attempts.add()

    class Late(FakeChild):
        def receive(self, timeout_s: float) -> Any:
            attempts.transitions.cancel(job.id)
            return SUCCEEDED

    assert attempts.supervise([Late()]).status == "cancelled"


def test_an_attempt_whose_lease_ended_records_nothing(attempts: Attempts) -> None:
    """Another service has taken the job up: its attempt counts, not this one."""
    job = attempts.add()

    def taken_away() -> None:
        claimed = attempts.jobs.get(TENANT, job.id)
        assert claimed is not None
        assert attempts.transitions.record_lost_attempt(claimed, "its lease ended")
        claim(attempts.transitions)

    now = attempts.run([taken_away, Progress("search", 0.5)])
    assert (now.id, now.status, now.attempt, now.stage) == (job.id, "running", 2, "queued")


def away(call: Callable[..., Any], times: int) -> Callable[..., Any]:
    """The call, which is refused so many times before it works."""
    left = [times]

    def wrapped(*args: Any, **kwargs: Any) -> Any:
        left[0] -= 1
        if left[0] >= 0:
            raise NotReadyError("The store is away.")
        return call(*args, **kwargs)

    return wrapped


@pytest.mark.parametrize(
    ("method", "lines", "status"),
    [
        ("record_progress", [Progress("search", 0.5), None], "succeeded"),
        ("is_current", [lambda: None, None], "succeeded"),
        ("succeed", [None], "succeeded"),
        ("fail", [FAILED], "failed"),
        ("record_lost_attempt", [ChildLostError("gone")], "queued"),
    ],
)
def test_a_store_that_is_away_for_a_while_loses_nothing(
    attempts: Attempts, monkeypatch: pytest.MonkeyPatch, method: str, lines: list[Any], status: str
) -> None:
    attempts.add()
    monkeypatch.setattr(
        attempts.transitions, method, away(getattr(attempts.transitions, method), 3)
    )
    said = [SUCCEEDED if line is None else line for line in lines]
    assert attempts.run(said).status == status


def test_a_store_that_stays_away_is_given_up(
    attempts: Attempts, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "RETRY_S", 0.05)
    attempts.add()
    monkeypatch.setattr(attempts.transitions, "fail", away(attempts.transitions.fail, 10**6))
    with pytest.raises(NotReadyError):
        attempts.run([FAILED])


def test_the_lease_is_extended_while_the_child_works(
    attempts: Attempts, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "HEARTBEAT_SHARE", 0.0)
    attempts.add()
    beats: list[str] = []
    monkeypatch.setattr(
        attempts.transitions, "extend_lease", lambda job, *, lease_s: beats.append(job.id) is None
    )
    assert attempts.run([Progress("search", 0.5), SUCCEEDED]).status == "succeeded"
    assert len(beats) == 1


def test_each_child_is_made_known_so_that_a_cancel_can_kill_it(attempts: Attempts) -> None:
    attempts.add(source=AWAY)
    attempts.fetch(Fetched(FETCHED, None, {}))
    (fetch,) = attempts.children
    attempts.run([SUCCEEDED])
    assert attempts.started == [fetch, *attempts.children]
