"""What is done from time to time: expired leases, deadlines, results, jobs and files."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable

from service.jobs.database import Database
from service.jobs.retention import drop_expired, needed_blobs
from service.jobs.store import JobStore
from service.settings import Settings
from service.storage import BlobStore

log = logging.getLogger(__name__)


class Upkeep:
    """A thread that looks for what has expired, every `upkeep_interval_s`."""

    def __init__(
        self,
        settings: Settings,
        database: Database,
        store: JobStore,
        blobs: BlobStore,
        announce: Callable[[str], None],
    ) -> None:
        self._settings = settings
        self._database = database
        self._store = store
        self._blobs = blobs
        self._announce = announce
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="upkeep", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self) -> None:
        """End, after the look that is under way."""
        self._stopping.set()
        self._thread.join()

    def once(self) -> None:
        """One look."""
        self._store.lose_all("its lease ended", lease_before=time.time())
        for job_id in self._store.miss_deadlines():
            self._announce(job_id)
        drop_expired(self._database)
        oldest = time.time() - self._settings.blob_grace_s
        removed = self._blobs.collect(lambda: needed_blobs(self._database), older_than=oldest)
        if removed:
            log.info("removed %d unused files", removed)

    def _run(self) -> None:
        while not self._stopping.wait(self._settings.upkeep_interval_s):
            try:
                self.once()
            except Exception:
                log.exception("upkeep met an unexpected error and goes on")
