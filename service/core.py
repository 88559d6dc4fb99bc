"""The parts of a running service, put together and taken apart."""

from __future__ import annotations

import fcntl
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from service.jobs.changes import Changes
from service.jobs.queue import Queue
from service.jobs.store import JobStore
from service.settings import Settings
from service.storage import BlobStore


@dataclass(frozen=True, slots=True)
class Service:
    """What the routes work with."""

    settings: Settings
    blobs: BlobStore
    store: JobStore
    queue: Queue
    changes: Changes


@contextmanager
def running_service(settings: Settings) -> Iterator[Service]:
    """Hold the data directory, open its store, work on its queue; stop in the reverse order."""
    with _sole_owner(settings.data_dir):
        blobs = BlobStore(settings.data_dir)
        blobs.discard_incoming()
        store = JobStore(
            f"sqlite:///{settings.data_dir / 'jobs.sqlite3'}", queue_limit=settings.queue_limit
        )
        changes = Changes()
        queue = Queue(store, settings, changes.announce)
        queue.start()
        try:
            yield Service(settings, blobs, store, queue, changes)
        finally:
            queue.stop()
            store.close()


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
