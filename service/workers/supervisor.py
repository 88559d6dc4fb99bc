"""Supervision of one attempt: child process, progress, heartbeat, time limits, outcome."""

from __future__ import annotations

import contextlib
import errno
import logging
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

from mpe_core.machine import count_oom_kills
from service.clouds.inputs import CLOUD_ROLES, CloudInput
from service.jobs.fingerprint import hash_work
from service.jobs.model import JobRow, Outcome
from service.jobs.sizes import LARGE
from service.jobs.transitions import JobTransitions
from service.outbound import FetchPolicy, HttpCache
from service.problems import (
    TYPE_PREFIX,
    BlobsUnavailableError,
    DeadlineError,
    DiskFullError,
    ExpiredError,
    JobMemoryError,
    JobTimeoutError,
    NotReadyError,
    error_document,
    is_disk_full,
)
from service.settings import Settings
from service.storage.blobs import Blob, BlobStore
from service.storage.decoded_cache import DecodedCache
from service.storage.disk_space import DiskSpace
from service.storage.scratch import count_bytes, scratch_folder
from service.workers.attempt_limits import AttemptLimits
from service.workers.child import (
    OUT_OF_MEMORY,
    Child,
    ChildLostError,
    ChildMemoryError,
    NoProcessError,
)
from service.workers.child_files import store_fetched, store_result
from service.workers.fetch_inputs import FetchInputs, aws_variables, is_fetched_once
from service.workers.lease import HEARTBEAT_SHARE, kept_lease
from service.workers.messages import (
    Answer,
    Failed,
    Fetched,
    FetchedFile,
    Message,
    Progress,
    Succeeded,
)
from service.workers.register_clouds import RegisterClouds, is_cached_decoded
from service.workers.spare import SpareChild
from service.workers.task import Task, TaskEnvironment

POLL_INTERVAL_S = 0.5
"""Interval of the checks whether another service on the same database has cancelled the job."""

RETRY_S = 30.0
"""Time that the end of an attempt is sent to a store that does not answer, in seconds."""

FREE_PROGRESS, PROGRESS_PER_S = 100, 10
"""Messages of progress that are recorded at once, and further ones for each second; a child sends
half as many."""

SMALL_SCRATCH_BYTES = 1 << 20
"""Bytes that an attempt may have written where the disk is short: it is not what fills it."""

DISK_FULL = TYPE_PREFIX + DiskFullError.problem.slug
"""Type of the problem that a child answers when it cannot write."""

JOB_MEMORY = TYPE_PREFIX + JobMemoryError.problem.slug
"""Type of the problem that a child answers when it gets no more memory."""

log = logging.getLogger(__name__)
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class AttemptSupervisor:
    """Runs attempts, each in a child process; belongs to one thread."""

    transitions: JobTransitions
    blobs: BlobStore
    settings: Settings
    started: Callable[[JobRow, Child], None]
    """Called with the job and its child, so that a cancel can kill it."""
    fetched: Callable[[], None]
    """Called when a job has been fetched and waits to be registered."""
    spare: SpareChild = field(default_factory=SpareChild)

    def run_attempt(self, job: JobRow) -> None:
        """Run one attempt at a claimed job and record how it ends."""
        oom_kills = count_oom_kills()
        name = f"{job.id}-{job.queue}-{job.attempt}"
        with scratch_folder(self.settings.data_dir, name) as scratch:
            try:
                self._attempt(job, scratch)
            except (JobTimeoutError, DeadlineError, ExpiredError) as error:
                document = error_document(error)
                _retry_while_unavailable(lambda: self.transitions.fail(job, document, {}))
            except OSError as error:
                if not is_disk_full(error):
                    raise
                self._interrupt_on_full_disk(job)
            except (NoProcessError, BlobsUnavailableError) as error:
                reason = str(error)
                _retry_while_unavailable(lambda: self.transitions.interrupt(job, reason))
                log.warning("attempt %d was interrupted: %s", job.attempt, reason)
            except ChildMemoryError:
                exceeded = JobMemoryError.beyond(self.settings.job_memory_bytes)
                self._end_for_memory(job, error_document(exceeded), {})
            except NotReadyError:
                log.warning("attempt %d was given up: the job store did not answer", job.attempt)
                raise
            except ChildLostError as lost:
                reason = str(lost)
                if lost.is_killed and count_oom_kills() > oom_kills:
                    self._end_for_memory(job, error_document(JobMemoryError(OUT_OF_MEMORY)), {})
                elif _retry_while_unavailable(
                    lambda: self.transitions.record_lost_attempt(job, reason)
                ):
                    log.warning("attempt %d was lost: %s", job.attempt, reason)

    def _attempt(self, job: JobRow, scratch: Path) -> None:
        environment = TaskEnvironment.create(
            job_id=job.id, tenant=job.tenant, scratch=scratch, settings=self.settings
        )
        if job.queue == "fetch":
            self._fetch(job, environment)
        else:
            self._register(job, environment)

    def _fetch(self, job: JobRow, environment: TaskEnvironment) -> None:
        policy = FetchPolicy.of(self.settings)
        secrets = aws_variables(job.source, job.target)
        task = FetchInputs(environment, job.source, job.target, policy, secrets)
        self._record_fetched(job, task, self._perform(job, task))

    def _register(self, job: JobRow, environment: TaskEnvironment) -> None:
        task = RegisterClouds(environment, job.source, job.target, job.options)
        with self._inputs(job):
            answer = self._perform(job, task)
        self._keep_decoded(job, environment.scratch)
        self._record_outcome(job, answer, environment.scratch)

    @contextmanager
    def _inputs(self, job: JobRow) -> Iterator[None]:
        """Keep the files of both clouds in the data directory.

        Raises
        ------
        ExpiredError
            One is missing in the store.
        """
        with ExitStack() as held:
            with kept_lease(self.transitions, job, lease_s=self.settings.lease_s):
                for role in CLOUD_ROLES:
                    self._hold(held, role, getattr(job, role))
            yield

    def _hold(self, held: ExitStack, role: str, cloud: CloudInput) -> None:
        assert cloud.sha256 is not None  # noqa: S101
        try:
            held.enter_context(self.blobs.hold(cloud.sha256))
        except FileNotFoundError:
            raise ExpiredError(
                f"{role}: its file is missing in the store; send it again."
            ) from None

    def _perform(self, job: JobRow, task: Task) -> Answer | None:
        """Have a child perform the task; return None when the job has been taken away."""
        limits = AttemptLimits.of(job, self.settings.job_timeout_s)
        child = self.spare.take()
        answer = None
        try:
            self.started(job, child)
            child.send_task(task)
            answer = self._await_answer(job, child, limits, task.environment.scratch)
        finally:
            child.kill()
            if answer is None or task.uses_network:  # what it fetched is moved, not copied
                child.close()
            else:
                self.spare.close_later(child)
        return answer

    def _await_answer(
        self, job: JobRow, child: Child, limits: AttemptLimits, scratch: Path
    ) -> Answer | None:
        """Record the child's progress and extend the lease until it answers.

        Returns
        -------
        Answer or None
            None when the attempt is no longer the job's.

        Raises
        ------
        JobTimeoutError, DeadlineError
            The time is over.
        OSError
            What the child writes leaves too little of the disk (ENOSPC).
        ChildLostError
            The child ended or sent nonsense.
        """
        disk = DiskSpace(self.settings.data_dir, self.settings.min_free_disk_bytes)
        started_at, recorded = time.monotonic(), 0
        lease_s = self.settings.lease_s
        next_heartbeat = started_at + HEARTBEAT_SHARE * lease_s
        is_current = True
        while is_current:
            message = child.receive(min(limits.remaining_s(), POLL_INTERVAL_S))
            if isinstance(message, Answer):
                return message
            if isinstance(message, Progress):
                recorded += 1
                if recorded > FREE_PROGRESS + PROGRESS_PER_S * (time.monotonic() - started_at):
                    recorded, message = recorded - 1, None  # each one is a row
            with contextlib.suppress(NotReadyError):  # the lease outlasts a short outage
                if time.monotonic() >= next_heartbeat:
                    is_current = self.transitions.extend_lease(job, lease_s=lease_s)
                    next_heartbeat = time.monotonic() + HEARTBEAT_SHARE * lease_s
                is_current = is_current and self._is_current_attempt(job, message)
            if disk.is_short and count_bytes(scratch) > SMALL_SCRATCH_BYTES:
                raise OSError(errno.ENOSPC, "too little of the disk would be left")
            if message is not None and job.queue != "fetch":
                self.spare.start()  # for the next task, while this one runs
        return None

    def _is_current_attempt(self, job: JobRow, message: Message | None) -> bool:
        """Record progress, if any, and return whether the job still belongs to this attempt."""
        if isinstance(message, Progress):
            return self.transitions.record_progress(job, message.stage, message.fraction)
        return self.transitions.is_current(job)

    def _record_fetched(self, job: JobRow, task: FetchInputs, answer: Answer | None) -> None:
        """Store the clouds and queue the job for a worker."""
        if not isinstance(answer, Fetched):
            self._record_failure(job, answer)
            return
        cache = HttpCache(self.settings.data_dir, job.tenant)
        with kept_lease(self.transitions, job, lease_s=self.settings.lease_s):
            source = self._with_content(job.source, answer.source, task.output("source"), cache)
            if is_fetched_once(job.source, job.target):
                target = replace(job.target, sha256=source.sha256, size=source.size)
            else:
                target = self._with_content(job.target, answer.target, task.output("target"), cache)
        fetched = replace(job, source=source, target=target, timing=answer.timing)
        if _retry_while_unavailable(lambda: self.transitions.record_fetched(fetched)):
            self.fetched()

    def _with_content(
        self, cloud: CloudInput, file: FetchedFile | None, path: Path, cache: HttpCache
    ) -> CloudInput:
        if not cloud.needs_fetching:
            return cloud
        if file is None:
            raise ChildLostError("it left out a file that it was to fetch")
        max_bytes = self.settings.max_body_bytes
        blob = store_fetched(file, path, self.blobs, cache, max_bytes=max_bytes)
        self._protect(blob)
        return replace(cloud, sha256=blob.sha256, size=blob.size)

    def _keep_decoded(self, job: JobRow, scratch: Path) -> None:
        """Cache the decoded forms that the child left of stored clouds."""
        cache = DecodedCache(self.settings.data_dir)
        for cloud in (job.source, job.target):
            if is_cached_decoded(cloud) and cloud.sha256 is not None:
                cache.adopt(job.tenant, cloud.sha256, scratch)

    def _record_outcome(self, job: JobRow, answer: Answer | None, scratch: Path) -> None:
        if not isinstance(answer, Succeeded):
            self._record_failure(job, answer)
            return
        with kept_lease(self.transitions, job, lease_s=self.settings.lease_s):
            result, inliers = _retry_while_unavailable(lambda: store_result(scratch, self.blobs))
        outcome = Outcome(
            result_sha256=result.sha256,
            inliers_sha256=inliers.sha256,
            result_bytes=result.size + inliers.size,
            confidence=answer.confidence,
            source=job.source,
            target=job.target,
            timing=job.timing | answer.timing,
            warnings=answer.warnings,
        )
        key = hash_work(job.source, job.target, job.options)
        if not _retry_while_unavailable(lambda: self.transitions.succeed(job, outcome, key)):
            log.warning("the result of attempt %d came too late and was refused", job.attempt)

    def _record_failure(self, job: JobRow, answer: Answer | None) -> None:
        """Record a Failed; do nothing without an answer.

        Raises
        ------
        ChildLostError
            The answer is that to another task.
        """
        if isinstance(answer, Failed) and self._is_for_want_of_disk(answer):
            self._interrupt_on_full_disk(job)
        elif isinstance(answer, Failed) and answer.problem.type == JOB_MEMORY:
            self._end_for_memory(job, asdict(answer.problem), job.timing | answer.timing)
        elif isinstance(answer, Failed):
            problem, timing = asdict(answer.problem), job.timing | answer.timing
            _retry_while_unavailable(lambda: self.transitions.fail(job, problem, timing))
        elif answer is not None:
            raise ChildLostError(f"it answered {answer.kind!r} to another task")

    def _is_for_want_of_disk(self, failed: Failed) -> bool:
        """Whether a child failed on a full disk."""
        if not failed.is_unexplained:
            return failed.problem.type == DISK_FULL
        return DiskSpace(self.settings.data_dir, self.settings.min_free_disk_bytes).is_short

    def _end_for_memory(
        self, job: JobRow, problem: dict[str, Any], timing: dict[str, float]
    ) -> None:
        """Queue a registration for a worker with more memory, or fail it."""
        is_registration = job.queue != "fetch" and LARGE not in self.settings.worker_labels
        if is_registration and _retry_while_unavailable(
            lambda: self.transitions.retry_on_larger(job)
        ):
            log.warning(
                "attempt %d ran out of memory; a worker with the label %s goes on",
                job.attempt,
                LARGE,
            )
            return
        _retry_while_unavailable(lambda: self.transitions.fail(job, problem, timing))

    def _interrupt_on_full_disk(self, job: JobRow) -> None:
        """Queue the job again: there may be room later, and it is not the job's fault."""
        document = error_document(DiskFullError())
        log.warning("attempt %d was interrupted: the disk is full", job.attempt)
        _retry_while_unavailable(
            lambda: self.transitions.interrupt(job, "the disk was full", document)
        )

    def _protect(self, blob: Blob) -> None:
        """Keep a blob from the clean-up until a row refers to it."""
        try:
            self.blobs.touch(blob.sha256)
        except FileNotFoundError as error:
            raise ChildLostError("what it fetched was removed before it was recorded") from error


def _retry_while_unavailable(record: Callable[[], T]) -> T:
    """Call `record` until the store answers, for RETRY_S seconds.

    Raises
    ------
    NotReadyError
        The store was unavailable all the time.
    """
    deadline = time.monotonic() + RETRY_S
    while time.monotonic() < deadline:
        with contextlib.suppress(NotReadyError):
            return record()
        time.sleep(POLL_INTERVAL_S)
    return record()
