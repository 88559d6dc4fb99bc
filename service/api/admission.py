"""Admission control: refuse a submission before its body is read if it cannot be processed."""

from __future__ import annotations

from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path

import psutil
from fastapi import Request
from starlette.concurrency import run_in_threadpool
from starlette.types import Message

from mpe_core.machine import memory_left
from service.auth.authenticator import Caller
from service.jobs.accept import check_queue_limit, check_tenant_queue_limit
from service.jobs.usage import ROW_BYTES
from service.problems import NotReadyError, OverloadedError, QuotaExceededError
from service.runtime import Runtime

AHEAD_BYTES = 1 << 20
"""Bytes that are reserved beyond those received of a body without Content-Length, if they fit."""


class BodyReservation:
    """Quota and disk for the body of one request, and for a row.

    Parameters
    ----------
    runtime : Runtime
        Parts of the service.
    caller : Caller
        Who sends the body.
    """

    def __init__(self, runtime: Runtime, caller: Caller) -> None:
        self._runtime = runtime
        self._caller = caller
        self._size: int | None = None
        self._received = 0

    def begin(self, size: int) -> None:
        """Reserve what is announced, as `reserve_bytes` does."""
        _reserve(self._runtime, self._caller, size)
        self._size = size

    def release(self) -> None:
        """Give back what is reserved."""
        if self._size is not None:
            _release(self._runtime, self._caller, self._size)

    async def count(self, received: int) -> None:
        """Count bytes that have arrived, and reserve more where they were not announced.

        Raises
        ------
        OverloadedError, QuotaExceededError
            There is no room for what has arrived.
        """
        assert self._size is not None  # noqa: S101
        self._received += received
        if self._received > self._size:
            await run_in_threadpool(self._grow)

    def _grow(self) -> None:
        try:
            self._grow_to(self._received + AHEAD_BYTES)
        except (OverloadedError, QuotaExceededError):
            self._grow_to(self._received)

    def _grow_to(self, size: int) -> None:
        assert self._size is not None  # noqa: S101
        _reserve_on_disk(self._runtime, size - self._size)
        try:
            self._runtime.storage_quota.reserve(self._caller, size - self._size)
        except QuotaExceededError:
            self._runtime.disk.release(size - self._size)
            raise
        self._size = size


@asynccontextmanager
async def reserve_body_bytes(
    request: Request, runtime: Runtime, caller: Caller
) -> AsyncIterator[Request]:
    """Reserve the size of the request's body and a row while the context lasts.

    Yields
    ------
    Request
        The request to read the body from: where its length is not announced, it is reserved as it
        arrives.

    Raises
    ------
    NotReadyError, QueueFullError, OverloadedError, QuotaExceededError
        As `reserve_bytes`.
    """
    reservation = BodyReservation(runtime, caller)
    announced = int(request.headers.get("content-length", 0))

    async def receive() -> Message:
        message = await request.receive()
        if message["type"] == "http.request":
            await reservation.count(len(message.get("body", b"")))
        return message

    try:
        await run_in_threadpool(reservation.begin, min(runtime.settings.max_body_bytes, announced))
        yield Request(request.scope, receive)
    finally:
        reservation.release()


@contextmanager
def reserve_bytes(runtime: Runtime, caller: Caller, size: int) -> Iterator[None]:
    """Check the capacity, and reserve quota and disk for bytes and a row while the context lasts.

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
        runtime.storage_quota.reserve(caller, size + ROW_BYTES)
    except QuotaExceededError:
        runtime.disk.release(size)
        raise


def _release(runtime: Runtime, caller: Caller, size: int) -> None:
    runtime.storage_quota.release(caller, size + ROW_BYTES)
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
