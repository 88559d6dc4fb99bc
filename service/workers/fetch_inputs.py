"""Task that fetches the clouds of a job from their URLs; it decodes nothing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from service.clouds.inputs import CloudInput
from service.outbound import FetchPolicy, HttpCache, fetch
from service.outbound.errors import AddressRefusedError, FetchError
from service.storage.blobs import BlobStore
from service.workers.messages import Fetched, StoredBlob
from service.workers.progress import ProgressReport
from service.workers.task import Task


def needs_fetching(cloud: CloudInput) -> bool:
    """Return whether the cloud is a URL that has not been fetched yet."""
    return cloud.sha256 is None and cloud.url is not None


@dataclass(frozen=True, slots=True)
class FetchInputs(Task):
    """Fetch those clouds of a job that need it."""

    uses_network: ClassVar[bool] = True

    source: CloudInput
    target: CloudInput
    policy: FetchPolicy

    def perform(self, report: ProgressReport) -> Fetched:
        """Fetch and store the clouds.

        Raises
        ------
        AddressRefusedError
            A URL may not be fetched.
        FetchError
            A URL could not be fetched; the subclass says why.
        """
        report.send("fetch", 0.0)
        with report.stage("fetch"):
            source = self._fetch_if_needed("source", self.source)
            target = self._fetch_if_needed("target", self.target)
        return Fetched(source, target, report.timing)

    def _fetch_if_needed(self, role: str, cloud: CloudInput) -> StoredBlob | None:
        if not needs_fetching(cloud):
            return None
        assert cloud.url is not None  # noqa: S101
        environment = self.environment
        blobs = BlobStore(environment.data_dir, incoming=environment.scratch)
        cache = HttpCache(environment.data_dir, blobs, environment.tenant)
        try:
            blob = fetch(cloud.url, self.policy, blobs, cache)
        except (AddressRefusedError, FetchError) as error:
            raise type(error)(f"{role}: {error}") from error
        return StoredBlob(blob.sha256, blob.size)
