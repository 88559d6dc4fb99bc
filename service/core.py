"""The parts of a running service, put together and taken apart."""

from __future__ import annotations

import fcntl
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from service.idempotency import KeysInFlight
from service.jobs.changes import Changes
from service.jobs.database import Database
from service.jobs.deliveries import DeliveryStore
from service.jobs.job import Retention
from service.jobs.queue import Queue
from service.jobs.store import JobStore
from service.jobs.webhooks import Webhooks
from service.settings import Settings
from service.storage import BlobStore
from service.upkeep import Upkeep


@dataclass(frozen=True, slots=True)
class Service:
    """What the routes work with."""

    settings: Settings
    blobs: BlobStore
    store: JobStore
    queue: Queue
    changes: Changes
    deliveries: DeliveryStore
    keys_in_flight: KeysInFlight = field(default_factory=KeysInFlight)


@contextmanager
def running_service(settings: Settings) -> Iterator[Service]:
    """Hold the data directory, open its store, work on its queue; stop in the reverse order."""
    with _sole_owner(settings.data_dir):
        blobs = BlobStore(settings.data_dir)
        blobs.discard_incoming()
        database = Database(f"sqlite:///{settings.data_dir / 'jobs.sqlite3'}")
        retention = Retention(result_s=settings.result_retention_s, job_s=settings.job_retention_s)
        store = JobStore(database, queue_limit=settings.queue_limit, retention=retention)
        changes = Changes()
        queue = Queue(store, settings, changes.announce)
        upkeep = Upkeep(settings, database, store, blobs, changes.announce)
        queue.start()
        upkeep.start()
        deliveries = DeliveryStore(database)
        webhooks = Webhooks(store, deliveries, settings)
        webhooks.start()
        try:
            yield Service(settings, blobs, store, queue, changes, deliveries)
        finally:
            webhooks.stop()
            upkeep.stop()
            queue.stop(grace_s=0)
            database.close()


@contextmanager
def _sole_owner(data_dir: Path) -> Iterator[None]:
    """RuntimeError when another process already serves the directory."""
    data_dir.mkdir(parents=True, exist_ok=True)
    with (data_dir / "lock").open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise RuntimeError(
                f"another service already uses {data_dir}; set MPE_DATA_DIR to another directory"
            ) from None
        yield
