"""Admission control: refuse a submission before its body is read if it cannot be processed."""

from __future__ import annotations

from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path

import psutil
from fastapi import Request
from starlette.concurrency import run_in_threadpool

from mpe_core.machine import memory_left
from service.auth.authenticator import Caller
from service.jobs.accept import check_queue_limit, check_tenant_queue_limit
from service.problems import NotReadyError, OverloadedError, QuotaExceededError
from service.runtime import Runtime


@asynccontextmanager
async def reserve_body_bytes(
    request: Request, runtime: Runtime, caller: Caller
) -> AsyncIterator[None]:
    """Reserve the size of the request's body, as `reserve_bytes` does.

    A body without Content-Length counts as the longest that is allowed.
    """
    max_bytes = runtime.settings.max_body_bytes
    size = min(max_bytes, int(request.headers.get("content-length", max_bytes)))
    await run_in_threadpool(_reserve, runtime, caller, size)
    try:
        yield
    finally:
        _release(runtime, caller, size)


@contextmanager
def reserve_bytes(runtime: Runtime, caller: Caller, size: int) -> Iterator[None]:
    """Check the capacity, and reserve bytes of quota and disk while the context lasts.

    Raises
    ------
    NotReadyError, QueueFullError, OverloadedError
        As `check_capacity`.
    QuotaExceededError
        The tenant has no room for so many bytes, or too many waiting registrations.
    """
    _reserve(runtime, caller, size)
    try:
        yield
    finally:
        _release(runtime, caller, size)


@contextmanager
def reserve_disk(runtime: Runtime, size: int) -> Iterator[None]:
    """Reserve bytes of the disk while the context lasts.

    Raises
    ------
    OverloadedError
        With what other requests are sending, too little would be left.
    """
    _reserve_on_disk(runtime, size)
    try:
        yield
    finally:
        runtime.disk.release(size)


def _reserve_on_disk(runtime: Runtime, size: int) -> None:
    if not runtime.disk.reserve(size):
        raise OverloadedError("Too little disk is left for the body; retry later.")


def _reserve(runtime: Runtime, caller: Caller, size: int) -> None:
    check_capacity(runtime, caller)
    _reserve_on_disk(runtime, size)
    try:
        runtime.storage_quota.reserve(caller, size)
    except QuotaExceededError:
        runtime.disk.release(size)
        raise


def _release(runtime: Runtime, caller: Caller, size: int) -> None:
    runtime.storage_quota.release(caller, size)
    runtime.disk.release(size)


def check_disk(runtime: Runtime) -> None:
    """Check that the disk has room.

    Raises
    ------
    OverloadedError
        Less than MPE_MIN_FREE_DISK_BYTES is free.
    """
    if runtime.disk.is_short:
        raise OverloadedError("Too little disk is left; retry later.")


@contextmanager
def count_file(runtime: Runtime, caller: Caller, path: Path) -> Iterator[None]:
    """Count a written file as stored by the tenant while the context lasts.

    Raises
    ------
    OverloadedError
        It leaves too little of the disk.
    QuotaExceededError
        It exceeds what the tenant may store.
    """
    check_disk(runtime)
    size = path.stat().st_size
    runtime.storage_quota.reserve(caller, size)
    try:
        yield
    finally:
        runtime.storage_quota.release(caller, size)


def free_memory() -> int:
    """Return the bytes that are free on the machine, or that the container may still take."""
    free, left = int(psutil.virtual_memory().available), memory_left()
    return free if left is None else min(free, left)


def check_capacity(runtime: Runtime, caller: Caller) -> None:
    """Check that the service could queue a registration of the caller now.

    Raises
    ------
    NotReadyError
        The service is stopping.
    QueueFullError
        The queue is full.
    QuotaExceededError
        The tenant has as many waiting registrations as it may.
    OverloadedError
        Disk or memory is short.
    """
    settings, tenant_limit = runtime.settings, caller.limits.queue_limit
    if runtime.workers.is_stopping:
        raise NotReadyError("The service is stopping; retry later.")
    check_queue_limit(runtime.jobs.count("queued"), settings.queue_limit)
    if tenant_limit is not None:
        check_tenant_queue_limit(runtime.jobs.count("queued", caller.tenant), tenant_limit)
    check_disk(runtime)
    if free_memory() < settings.min_free_memory_bytes:
        raise OverloadedError("Too little memory is left; retry later.")
