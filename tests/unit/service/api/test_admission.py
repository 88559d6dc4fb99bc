"""Admission: a submission that could not be queued is refused before its body is read."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

from service.api.admission import (
    check_capacity,
    check_disk,
    count_file,
    reserve_body_bytes,
    reserve_bytes,
    reserve_disk,
)
from service.auth.authenticator import Caller
from service.auth.keys import KeyLimits
from service.auth.quotas import StorageQuota
from service.jobs.usage import ROW_BYTES
from service.problems import (
    NotReadyError,
    OverloadedError,
    QueueFullError,
    QuotaExceededError,
    ServiceError,
)
from service.runtime import Runtime
from tests.factories.api import IdleWorkers, idle_runtime, request_of
from tests.factories.jobs import TENANT, new_job

CALLER = Caller(TENANT, KeyLimits(stored_bytes=ROW_BYTES + 100, queue_limit=1))
PLENTY = 2**60


def on_runtime(root: Path, check: Callable[[Runtime], None], **settings: Any) -> None:
    async def run() -> None:
        with idle_runtime(root, **settings) as runtime:
            check(runtime)

    asyncio.run(run())


def fill(runtime: Runtime) -> None:
    runtime.submit(new_job())


def stop(runtime: Runtime) -> None:
    assert isinstance(runtime.workers, IdleWorkers)
    runtime.workers.is_stopping = True


@pytest.mark.parametrize(
    ("settings", "prepare", "error", "words"),
    [
        ({}, stop, NotReadyError, "stopping"),
        ({"queue_limit": 1}, fill, QueueFullError, "limit 1"),
        ({}, fill, QuotaExceededError, "limit 1"),
        ({"min_free_disk_bytes": PLENTY}, None, OverloadedError, "disk"),
        ({"min_free_memory_bytes": PLENTY}, None, OverloadedError, "memory"),
    ],
)
def test_why_there_is_no_capacity(
    tmp_path: Path,
    settings: dict[str, Any],
    prepare: Callable[[Runtime], None] | None,
    error: type[ServiceError],
    words: str,
) -> None:
    def check(runtime: Runtime) -> None:
        if prepare is not None:
            check_capacity(runtime, CALLER)
            prepare(runtime)
        with pytest.raises(error, match=words) as raised:
            check_capacity(runtime, CALLER)
        assert int(raised.value.headers["Retry-After"]) > 0

    on_runtime(tmp_path, check, **settings)


def test_a_full_share_does_not_stop_other_tenants(tmp_path: Path) -> None:
    def check(runtime: Runtime) -> None:
        fill(runtime)
        check_capacity(runtime, Caller("other", KeyLimits(queue_limit=1)))

    on_runtime(tmp_path, check)


def test_reserved_bytes_are_released_even_after_an_error(tmp_path: Path) -> None:
    def check(runtime: Runtime) -> None:
        def fail() -> None:
            with reserve_bytes(runtime, CALLER, 60):
                with pytest.raises(QuotaExceededError), reserve_bytes(runtime, CALLER, 60):
                    pass
                raise ZeroDivisionError

        with mock.patch.object(StorageQuota, "release") as release:
            with pytest.raises(ZeroDivisionError):
                fail()
            release.assert_called_once_with(CALLER, 60 + ROW_BYTES)

    on_runtime(tmp_path, check)


@pytest.mark.parametrize(
    ("headers", "reserved"),
    [({"Content-Length": "40"}, 40), ({"Content-Length": "5000"}, 90), ({}, 0)],
)
def test_what_is_announced_is_reserved(
    tmp_path: Path, headers: dict[str, str], reserved: int
) -> None:
    async def run() -> None:
        with idle_runtime(tmp_path, max_body_bytes=90) as runtime:
            async with reserve_body_bytes(request_of([], headers), runtime, CALLER):
                assert runtime.storage_quota.used(TENANT) == reserved + ROW_BYTES

    asyncio.run(run())


def test_a_body_without_length_is_reserved_as_it_arrives(tmp_path: Path) -> None:
    async def run() -> None:
        with idle_runtime(tmp_path) as runtime:
            request = request_of([b"x" * 60, b"x" * 40, b"x"], {})
            async with reserve_body_bytes(request, runtime, CALLER) as counted:
                chunks = counted.stream()
                for reserved in (60, 100):
                    await anext(chunks)
                    assert runtime.storage_quota.used(TENANT) - ROW_BYTES == reserved
                with pytest.raises(QuotaExceededError):
                    await anext(chunks)
            assert runtime.storage_quota.used(TENANT) - ROW_BYTES == 100  # until the next count

    asyncio.run(run())


def test_announced_bytes_of_all_requests_are_reserved_on_the_disk(tmp_path: Path) -> None:
    def check(runtime: Runtime) -> None:
        room = runtime.disk.free_bytes - runtime.settings.min_free_disk_bytes
        other = Caller("other", KeyLimits())
        most = int(0.7 * room)
        with reserve_bytes(runtime, other, most):
            for refuse in (
                lambda: reserve_bytes(runtime, other, most),
                lambda: reserve_disk(runtime, most),
            ):
                with pytest.raises(OverloadedError, match="disk"), refuse():
                    pass
        with reserve_disk(runtime, most):
            pass

    on_runtime(tmp_path, check, min_free_disk_bytes=0)


def test_a_refusal_by_the_quota_reserves_no_disk(tmp_path: Path) -> None:
    def check(runtime: Runtime) -> None:
        most = int(0.7 * runtime.disk.free_bytes)
        for _ in range(3):
            with (
                pytest.raises(QuotaExceededError),
                reserve_bytes(runtime, Caller("other", KeyLimits(stored_bytes=1)), most),
            ):
                pass

    on_runtime(tmp_path, check, min_free_disk_bytes=0)


def test_a_written_file_counts_as_stored_while_it_is_sent(tmp_path: Path) -> None:
    caller = Caller(TENANT, KeyLimits(stored_bytes=100))
    path = tmp_path / "aligned.ply"
    path.write_bytes(bytes(60))

    def check(runtime: Runtime) -> None:
        with count_file(runtime, caller, path):
            assert runtime.storage_quota.used(TENANT) == 60
            with pytest.raises(QuotaExceededError), count_file(runtime, caller, path):
                pass

    on_runtime(tmp_path, check)


def test_no_file_is_written_on_a_full_disk(tmp_path: Path) -> None:
    def check(runtime: Runtime) -> None:
        with pytest.raises(OverloadedError, match="disk"):
            check_disk(runtime)

    on_runtime(tmp_path, check, min_free_disk_bytes=PLENTY)
