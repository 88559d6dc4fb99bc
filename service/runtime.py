"""The parts of a service, put together and taken apart."""

from __future__ import annotations

import fcntl
import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from service.auth.authenticator import Authenticator
from service.auth.keys import KeyStore
from service.auth.quotas import StorageQuota
from service.auth.rate_limit import RateLimiter
from service.clouds.store import CloudStore
from service.clouds.uploads import UploadStore
from service.database.engine import Database, open_database
from service.jobs.idempotency import InFlightKeys
from service.jobs.model import Retention
from service.jobs.notifier import JobNotifier
from service.jobs.retention import drop_expired, needed_blobs, referable_blobs
from service.jobs.store import JobStore
from service.outbound import prune_http_cache
from service.settings import Settings
from service.storage.blobs import BlobStore
from service.storage.decoded_cache import DecodedCache
from service.storage.scratch import discard_scratch
from service.telemetry.metrics import Metrics
from service.telemetry.recorder import Telemetry
from service.telemetry.tracing import Tracing
from service.webhooks.outbox import Outbox
from service.webhooks.sender import WebhookSender
from service.workers.maintenance import Maintenance, Task
from service.workers.pool import WorkerPool

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Runtime:
    """What the routes work with."""

    settings: Settings
    database: Database
    blobs: BlobStore
    store: JobStore
    queue: WorkerPool
    changes: JobNotifier
    deliveries: Outbox
    clouds: CloudStore
    uploads: UploadStore
    telemetry: Telemetry
    gate: Authenticator
    shares: StorageQuota
    rate_limit: RateLimiter = field(default_factory=RateLimiter)
    keys_in_flight: InFlightKeys = field(default_factory=InFlightKeys)


@contextmanager
def running_service(settings: Settings, metrics: Metrics) -> Iterator[Runtime]:
    """Hold the data directory, open its store, work on its queue; stop in the reverse order."""
    with _owned(settings.data_dir, shared=settings.database_url is not None):
        service = _assemble(settings, metrics)
        service.blobs.discard_incoming()
        webhooks = WebhookSender(service.store, service.deliveries, settings)
        maintenance = Maintenance(_maintenance_tasks(service), settings.upkeep_interval_s)
        for part in (service.queue, maintenance, webhooks):
            part.start()
        try:
            yield service
        finally:
            webhooks.stop()
            maintenance.stop()
            service.queue.stop(grace_s=0)
            service.telemetry.close()
            service.database.close()


def _assemble(settings: Settings, metrics: Metrics) -> Runtime:
    blobs = BlobStore(settings.data_dir)
    database = open_database(settings)
    retention = Retention(result_s=settings.result_retention_s, job_s=settings.job_retention_s)
    store = JobStore(database, queue_limit=settings.queue_limit, retention=retention)
    changes = JobNotifier()
    tracing = None if settings.otlp_endpoint is None else Tracing(settings.otlp_endpoint)
    telemetry = Telemetry(metrics, tracing)
    metrics.watch(store)
    return Runtime(
        settings=settings,
        database=database,
        blobs=blobs,
        store=store,
        queue=WorkerPool(store, blobs, settings, changes.announce, telemetry.ended),
        changes=changes,
        deliveries=Outbox(database),
        clouds=CloudStore(database, blobs, retention_s=settings.cloud_retention_s),
        uploads=UploadStore(
            database, settings.data_dir / "uploads", retention_s=settings.upload_retention_s
        ),
        telemetry=telemetry,
        gate=Authenticator(KeyStore(database), settings),
        shares=StorageQuota(database),
    )


def _maintenance_tasks(service: Runtime) -> list[Task]:
    """Return what is done from time to time, in its order: what has expired keeps no file."""
    settings, database = service.settings, service.database
    prepared = DecodedCache(settings.data_dir / "prepared")

    def expire_leases() -> None:
        service.store.lose_all("its lease ended", lease_before=time.time())

    def fail_overdue() -> None:
        for job_id in service.store.miss_deadlines():
            service.changes.announce(job_id)

    def collect_blobs() -> None:
        removed = service.blobs.collect(
            lambda: needed_blobs(database), now=time.time(), grace_s=settings.blob_grace_s
        )
        if removed:
            log.info("removed %d unused files", removed)

    return [
        expire_leases,
        fail_overdue,
        lambda: discard_scratch(settings.data_dir, service.store.running),
        lambda: drop_expired(database),
        service.uploads.drop_expired,
        collect_blobs,
        lambda: prepared.collect(referable_blobs(database)),
        lambda: prune_http_cache(settings.data_dir, service.blobs),
    ]


@contextmanager
def _owned(data_dir: Path, *, shared: bool) -> Iterator[None]:
    """Hold the directory, alone or with others who share it; RuntimeError when that cannot be."""
    data_dir.mkdir(parents=True, exist_ok=True)
    with (data_dir / "lock").open("w") as lock:
        try:
            fcntl.flock(lock, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
        except BlockingIOError:
            raise RuntimeError(
                f"another service already uses {data_dir}; set MPE_DATA_DIR to another directory"
            ) from None
        yield
