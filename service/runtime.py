"""The parts of a service, put together and taken apart."""

from __future__ import annotations

import fcntl
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from service.clouds.store import CloudStore
from service.core import Service
from service.auth.authenticator import Gate
from service.jobs.notifier import Changes
from service.database.engine import open_database
from service.webhooks.outbox import DeliveryStore
from service.jobs.model import Retention
from service.workers.pool import Queue
from service.jobs.store import JobStore
from service.webhooks.sender import Webhooks
from service.auth.keys import KeyStore
from service.telemetry.metrics import Metrics
from service.settings import Settings
from service.auth.quotas import Shares
from service.storage.blobs import BlobStore
from service.telemetry.recorder import Telemetry
from service.telemetry.tracing import Tracing
from service.workers.maintenance import Upkeep
from service.clouds.uploads import UploadStore


@contextmanager
def running_service(settings: Settings, metrics: Metrics) -> Iterator[Service]:
    """Hold the data directory, open its store, work on its queue; stop in the reverse order."""
    with _owned(settings.data_dir, shared=settings.database_url is not None):
        service = _assemble(settings, metrics)
        service.blobs.discard_incoming()
        webhooks = Webhooks(service.store, service.deliveries, settings)
        upkeep = Upkeep(service)
        for part in (service.queue, upkeep, webhooks):
            part.start()
        try:
            yield service
        finally:
            webhooks.stop()
            upkeep.stop()
            service.queue.stop(grace_s=0)
            service.telemetry.recorder.close()
            service.database.close()


def _assemble(settings: Settings, metrics: Metrics) -> Service:
    blobs = BlobStore(settings.data_dir)
    database = open_database(settings)
    retention = Retention(result_s=settings.result_retention_s, job_s=settings.job_retention_s)
    store = JobStore(database, queue_limit=settings.queue_limit, retention=retention)
    changes = Changes()
    tracing = None if settings.otlp_endpoint is None else Tracing(settings.otlp_endpoint)
    telemetry = Telemetry(metrics, tracing)
    metrics.watch(store)
    return Service(
        settings=settings,
        database=database,
        blobs=blobs,
        store=store,
        queue=Queue(store, blobs, settings, changes.announce, telemetry.ended),
        changes=changes,
        deliveries=DeliveryStore(database),
        clouds=CloudStore(database, blobs, retention_s=settings.cloud_retention_s),
        uploads=UploadStore(
            database, settings.data_dir / "uploads", retention_s=settings.upload_retention_s
        ),
        telemetry=telemetry,
        gate=Gate(KeyStore(database), settings),
        shares=Shares(database),
    )


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
