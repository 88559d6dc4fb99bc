"""The clouds of a job that are not here yet, fetched in a child process that decodes nothing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace
from typing import Any

from service.clouds.inputs import CloudInput
from service.outbound import HttpCache, fetch
from service.outbound.errors import AddressRefusedError, FetchError
from service.storage.blobs import BlobStore
from service.workers.task import FetchTask


def is_needed(cloud: CloudInput) -> bool:
    """Whether the cloud is not here yet."""
    return cloud.sha256 is None and cloud.url is not None


def fetched(task: FetchTask, report: Callable[[str, float], None]) -> dict[str, Any]:
    """Source and target as they are once they are here; AddressRefusedError, FetchError."""
    report("fetch", 0.0)
    blobs = BlobStore(task.data_dir, incoming=task.scratch)
    known = HttpCache(task.data_dir, blobs, task.tenant)
    return {
        role: asdict(_here(role, cloud, task, blobs, known))
        for role, cloud in (("source", task.source), ("target", task.target))
    }


def _here(
    role: str, cloud: CloudInput, task: FetchTask, blobs: BlobStore, known: HttpCache
) -> CloudInput:
    if not is_needed(cloud):
        return cloud
    assert cloud.url is not None  # noqa: S101
    try:
        blob = fetch(cloud.url, task.rules, blobs, known)
    except (AddressRefusedError, FetchError) as error:
        raise type(error)(f"{role}: {error}") from error
    return replace(cloud, sha256=blob.sha256, size=blob.size)
