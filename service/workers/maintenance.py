"""What is done from time to time: expired leases, deadlines, results, jobs and files."""

from __future__ import annotations

import logging
import threading
import time

from service.core import Service
from service.outbound import forget_removed
from service.storage.decoded_cache import PreparedClouds
from service.jobs.retention import drop_expired, needed_blobs, referable_blobs
from service.storage.scratch import discard_scratch

log = logging.getLogger(__name__)


class Upkeep:
    """A thread that looks for what has expired, every `upkeep_interval_s`."""

    def __init__(self, service: Service) -> None:
        self._service = service
        self._prepared = PreparedClouds(service.settings.data_dir / "prepared")
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
        service, database = self._service, self._service.database
        service.store.lose_all("its lease ended", lease_before=time.time())
        for job_id in service.store.miss_deadlines():
            service.changes.announce(job_id)
        discard_scratch(service.settings.data_dir, service.store.running)
        drop_expired(database)
        service.clouds.uploads.drop_expired()
        removed = service.blobs.collect(
            lambda: needed_blobs(database),
            now=time.time(),
            grace_s=service.settings.blob_grace_s,
        )
        self._prepared.collect(referable_blobs(database))
        forget_removed(service.settings.data_dir, service.blobs)
        if removed:
            log.info("removed %d unused files", removed)

    def _run(self) -> None:
        while not self._stopping.wait(self._service.settings.upkeep_interval_s):
            try:
                self.once()
            except Exception:
                log.exception("upkeep met an unexpected error and goes on")
