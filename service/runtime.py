"""The parts of a running service: opened, wired together, and closed in the reverse order."""

from __future__ import annotations

import fcntl
import logging
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, Protocol

from service.auth.authenticator import Authenticator
from service.auth.keys import KeyStore
from service.auth.quotas import StorageQuota
from service.auth.rate_limit import RateLimiter
from service.clouds.appends import ActiveAppends
from service.clouds.direct_uploads import DirectUploads
from service.clouds.shared_uploads import SharedUploadStore
from service.clouds.store import CloudStore
from service.clouds.uploads import UploadStore
from service.database.engine import Database, Listening
from service.database.store import open_store
from service.jobs.announcements import Announcement
from service.jobs.idempotency import Idempotency, InFlightKeys
from service.jobs.missing_workers import MissingWorkers
from service.jobs.model import JobRow, Retention
from service.jobs.notifier import JobNotifier
from service.jobs.queries import JobQueries
from service.jobs.retention import drop_expired, find_cloud_blobs, find_needed_blobs
from service.jobs.transitions import JobTransitions
from service.jobs.worker_slots import ANNOUNCE_INTERVAL_S, WorkerSlots
from service.outbound import http_cache
from service.problems import NotReadyError
from service.settings import Settings
from service.storage.blobs import BlobStore
from service.storage.bucket import Bucket
from service.storage.decoded_cache import DecodedCache
from service.storage.disk_space import DiskSpace
from service.storage.open_blobs import open_blobs
from service.storage.s3_blobs import S3BlobStore
from service.storage.scratch import discard_scratch
from service.storage.store_mark import StoreMark
from service.telemetry.metrics import Metrics
from service.telemetry.recorder import Telemetry
from service.telemetry.tracing import Tracing
from service.webhooks.outbox import Outbox
from service.webhooks.sender import WebhookSender
from service.workers.child import stop_forkserver
from service.workers.exporter import MAX_RUNNING, Exporter
from service.workers.lease import HEARTBEAT_SHARE
from service.workers.maintenance import Maintenance, MaintenanceTask
from service.workers.pool import WorkerPool
from service.workers.tenant_gate import TenantGate

DEADLINE_INTERVAL_S = 0.5
"""Interval of the looks for deadlines and leases that have passed, in seconds."""

MAX_READING = 2
"""Files that were sent to the store directly that are read and hashed at once."""

LEADER_PAUSE = 2
"""Heartbeats that a new leader waits for before it ends leases."""

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Runtime:
    """The parts of a running service that the API calls."""

    settings: Settings
    database: Database
    blobs: BlobStore
    jobs: JobQueries
    transitions: JobTransitions
    notifier: JobNotifier
    workers: WorkerPool
    exporter: Exporter
    clouds: CloudStore
    uploads: UploadStore
    direct_uploads: DirectUploads | None
    """None where callers do not reach the store of the files."""
    outbox: Outbox
    telemetry: Telemetry
    authenticator: Authenticator
    storage_quota: StorageQuota
    disk: DiskSpace
    slots: WorkerSlots
    missing_workers: MissingWorkers
    rate_limiter: RateLimiter = field(default_factory=RateLimiter)
    in_flight_keys: InFlightKeys = field(default_factory=InFlightKeys)
    export_gate: TenantGate = field(default_factory=lambda: TenantGate(MAX_RUNNING, "exports"))
    reading_gate: TenantGate = field(default_factory=lambda: TenantGate(MAX_READING, "uploads"))
    appends: ActiveAppends = field(default_factory=ActiveAppends)

    def submit(
        self,
        job: JobRow,
        idempotency: Idempotency | None = None,
        *,
        tenant_queue_limit: int | None = None,
    ) -> JobRow:
        """Accept a job and wake a worker; see `service.jobs.accept.accept_job`."""
        accepted = self.transitions.add(job, idempotency, tenant_queue_limit=tenant_queue_limit)
        self.workers.notify(accepted.queue)
        return accepted

    def cancel(self, job_id: str) -> bool:
        """Cancel a job and kill its process; return False when it has ended or is unknown."""
        is_cancelled = self.transitions.cancel(job_id)
        if is_cancelled:
            self.workers.kill(job_id)
        return is_cancelled

    def hear(self, message: str) -> None:
        """React to a change of a job by another process on the database, or by this one."""
        announced = Announcement.decode(message)
        if announced is None:
            return
        if announced.change == "queued":
            self.workers.notify(announced.queue)
        if announced.change == "ended":
            self.workers.kill(announced.job_id)
        self.notifier.wake(announced.job_id, has_ended=announced.change == "ended")

    def look_again(self) -> None:
        """Look at everything that is waited for, because changes may not have been heard."""
        self.workers.notify_all()
        self.notifier.wake_all()

    def drain(self) -> None:
        """Be ready no longer; then begin no more jobs, requeue those that run after the grace.

        All who wait are woken at the end.
        """
        self.workers.leave()
        time.sleep(self.settings.shutdown_delay_s)
        self.workers.stop(self.settings.shutdown_grace_s)
        self.notifier.wake_all()


class _Part(Protocol):
    def start(self) -> None: ...
    def stop(self) -> None: ...


Role = Literal["all", "api", "worker"]
"""What a service does: everything, all but to run registrations, or only that."""


@contextmanager
def open_runtime(settings: Settings, metrics: Metrics, role: Role = "all") -> Iterator[Runtime]:
    """Run a service: hold its data directory, open its parts, start its threads.

    Raises
    ------
    RuntimeError
        Another service uses the data directory, a later release has written the database, or the
        job store is lost.
    """
    with ExitStack() as stack:
        stack.enter_context(_lock_data_dir(settings.data_dir, shared=settings.shares_data_dir))
        database = stack.enter_context(closing(open_store(settings)))
        keys = KeyStore(database)
        if keys.any_exist():
            StoreMark(settings.data_dir).record_keys()
        disk = DiskSpace(settings.data_dir, settings.min_free_disk_bytes)
        disk.adjust_fallback()
        blobs = open_blobs(settings)
        blobs.discard_incoming()
        tracing = None if settings.otlp_endpoint is None else Tracing(settings.otlp_endpoint)
        telemetry = stack.enter_context(closing(Telemetry(metrics, tracing)))
        clouds = CloudStore(database, blobs, retention_s=settings.cloud_retention_s)
        uploads = _open_uploads(settings, database, clouds, blobs)
        notifier = JobNotifier()
        jobs = JobQueries(database)
        transitions = JobTransitions(
            database,
            queue_limit=settings.queue_limit,
            retention=Retention(settings.result_retention_s, settings.job_retention_s),
            is_stored=blobs.exists,
            large_bytes=settings.large_bytes,
            listeners=(telemetry, notifier),
        )
        slots = WorkerSlots(
            database, 0 if role == "api" else settings.workers, settings.worker_labels
        )
        runtime = Runtime(
            settings=settings,
            database=database,
            blobs=blobs,
            jobs=jobs,
            transitions=transitions,
            notifier=notifier,
            workers=WorkerPool(transitions, blobs, settings, runs_jobs=role != "api"),
            exporter=Exporter(settings, blobs),
            clouds=clouds,
            uploads=uploads,
            direct_uploads=_open_direct_uploads(settings, database, clouds, blobs),
            outbox=Outbox(database),
            telemetry=telemetry,
            authenticator=Authenticator(keys, settings),
            storage_quota=StorageQuota(database),
            disk=disk,
            slots=slots,
            missing_workers=MissingWorkers(jobs, slots),
        )
        stack.callback(stop_forkserver)
        slots.begin()
        stack.callback(_withdraw, runtime)
        listening = stack.enter_context(closing(database.listen(runtime.hear, runtime.look_again)))
        metrics.watch(jobs, slots, runtime.missing_workers, lambda: listening.is_leader)
        parts: list[_Part] = [
            runtime.workers,
            Maintenance(_urgent_tasks(runtime, listening), DEADLINE_INTERVAL_S),
            Maintenance(_maintenance_tasks(runtime, listening), settings.maintenance_interval_s),
            Maintenance({"announce workers": runtime.slots.announce}, ANNOUNCE_INTERVAL_S),
            WebhookSender(jobs, runtime.outbox, settings, is_leader=lambda: listening.is_leader),
        ]
        for part in parts:
            part.start()
            stack.callback(part.stop)
        stack.callback(runtime.exporter.stop)
        yield runtime


def _open_uploads(
    settings: Settings, database: Database, clouds: CloudStore, blobs: BlobStore
) -> UploadStore:
    directory, retention_s = settings.data_dir / "uploads", settings.upload_retention_s
    if settings.blob.url is None:
        return UploadStore(database, clouds, directory, retention_s=retention_s)
    return SharedUploadStore(database, clouds, blobs, directory, retention_s=retention_s)


def _open_direct_uploads(
    settings: Settings, database: Database, clouds: CloudStore, blobs: BlobStore
) -> DirectUploads | None:
    if settings.blob.url is None or settings.blob.public_endpoint is None:
        return None
    assert isinstance(blobs, S3BlobStore)  # noqa: S101
    retention_s = settings.upload_retention_s
    return DirectUploads(database, clouds, Bucket(settings.blob), blobs, retention_s=retention_s)


def _withdraw(runtime: Runtime) -> None:
    with suppress(NotReadyError):  # then it ends by itself
        runtime.slots.withdraw()


def _once_for_all(
    task: MaintenanceTask, listening: Listening, *, after_s: float = 0.0
) -> MaintenanceTask:
    """Return a task that only the service that leads does, once it has led for `after_s`."""
    return lambda: task() if listening.is_leader and listening.led_s >= after_s else None


def _urgent_tasks(runtime: Runtime, listening: Listening) -> dict[str, MaintenanceTask]:
    """Return the tasks that callers wait for."""
    transitions = runtime.transitions
    # after an outage of the database workers need a moment to extend what ended meanwhile
    pause_s = LEADER_PAUSE * HEARTBEAT_SHARE * runtime.settings.lease_s
    return {
        "fail overdue": _once_for_all(transitions.fail_overdue, listening),
        "expire leases": _once_for_all(
            lambda: transitions.expire_leases(runtime.workers.held_jobs()),
            listening,
            after_s=pause_s,
        ),
    }


def _maintenance_tasks(runtime: Runtime, listening: Listening) -> dict[str, MaintenanceTask]:
    """Return the tasks in their order: what makes room first, rows before the files they need."""
    settings, database = runtime.settings, runtime.database
    decoded = DecodedCache(settings.data_dir)

    def needed() -> set[str]:
        return find_needed_blobs(database)

    def collect_decoded() -> None:
        """Remove what no cloud needs, and everything where the disk is short: it can be redone."""
        decoded.collect(set() if runtime.disk.is_short else find_cloud_blobs(database))

    def collect_blobs() -> None:
        removed = runtime.blobs.collect(needed, now=time.time(), grace_s=settings.blob.grace_s)
        if removed:
            log.info("removed %d unused files", removed)

    def collect_direct_uploads() -> None:
        if runtime.direct_uploads is not None:
            runtime.direct_uploads.collect()

    def collect_shared_blobs() -> None:
        removed = runtime.blobs.collect_shared(needed, grace_s=settings.blob.grace_s)
        if removed:
            log.info("removed %d unused objects of the bucket", removed)

    return {
        "adjust the fallback file": runtime.disk.adjust_fallback,
        "discard scratch folders": lambda: discard_scratch(settings.data_dir),
        "drop expired uploads": runtime.uploads.drop_expired,
        "drop expired rows": _once_for_all(lambda: drop_expired(database), listening),
        "collect blobs": collect_blobs,
        "collect shared blobs": _once_for_all(collect_shared_blobs, listening),
        "collect direct uploads": _once_for_all(collect_direct_uploads, listening),
        "collect decoded clouds": collect_decoded,
        "prune the HTTP cache": lambda: http_cache.prune(settings.data_dir, runtime.blobs),
        "log missing workers": _once_for_all(runtime.missing_workers.log, listening),
    }


@contextmanager
def _lock_data_dir(data_dir: Path, *, shared: bool) -> Iterator[None]:
    """Hold the directory, alone or beside other services that share the database.

    Raises
    ------
    RuntimeError
        Another service holds it.
    """
    data_dir.mkdir(parents=True, exist_ok=True)
    with (data_dir / "lock").open("w") as lock:
        try:
            fcntl.flock(lock, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
        except BlockingIOError:
            raise RuntimeError(
                f"another service already uses {data_dir}; set MPE_DATA_DIR to another directory"
            ) from None
        yield
