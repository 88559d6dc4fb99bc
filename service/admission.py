"""Whether the service can take on more, asked before a body is read."""

from __future__ import annotations

import shutil

import psutil

from service.core import Service
from service.jobs.intake import check_room
from service.problems import NotReadyError, OverloadedError

RETRY_AFTER_S = 30


def admit(service: Service) -> None:
    """NotReadyError, QueueFullError or OverloadedError when a submission would come to nothing."""
    settings = service.settings
    if service.queue.is_stopping:
        raise NotReadyError("The service is stopping.", headers={"Retry-After": "5"})
    check_room(service.store.count("queued"), settings.queue_limit)
    if shutil.disk_usage(settings.data_dir).free < settings.min_free_disk_bytes:
        raise _overloaded("disk")
    if psutil.virtual_memory().available < settings.min_free_memory_bytes:
        raise _overloaded("memory")


def _overloaded(resource: str) -> OverloadedError:
    return OverloadedError(
        f"Too little {resource} is left; try again later.",
        headers={"Retry-After": str(RETRY_AFTER_S)},
    )
