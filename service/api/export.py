"""Responses whose file is written on demand, in a process of its own."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator
from contextlib import AbstractContextManager, ExitStack, asynccontextmanager
from pathlib import Path
from typing import Any

from fastapi import Request
from starlette.concurrency import run_in_threadpool

from service.api.admission import check_disk, count_file
from service.api.disconnect import unless_disconnected, until_disconnected
from service.api.middleware.conditional import is_known
from service.api.threads import OwnThreads
from service.auth.authenticator import Caller
from service.jobs.model import JobRow
from service.problems import ExpiredError, ResultNotReadyError
from service.runtime import Runtime
from service.schemas.serialize_result import read_summary
from service.workers.aligned_pair import AlignedPair
from service.workers.exporter import MAX_RUNNING, ExportedFile, is_abandoned

FILE = "application/octet-stream"
_EXPORTS = OwnThreads(MAX_RUNNING)


def require_blobs(runtime: Runtime, *hashes: str | None) -> list[Path]:
    """Return the paths of stored files.

    Raises
    ------
    ExpiredError
        One of them is no longer stored.
    """
    try:
        if None not in hashes:
            return [runtime.blobs.fetch(each) for each in hashes if each is not None]
    except FileNotFoundError:
        pass
    raise ExpiredError("The result or a cloud has expired; register the clouds again.")


def require_pair(job: JobRow, runtime: Runtime) -> tuple[AlignedPair, dict[str, Any]]:
    """Return what tasks need of a registration, and its result without the inlier pairs.

    Raises
    ------
    ResultNotReadyError
        It has not succeeded.
    ExpiredError
        Its result or a cloud is no longer stored.
    """
    if job.status != "succeeded":
        raise ResultNotReadyError(
            f"The registration is {job.status}; only a result can be applied."
        )
    path, *_ = require_blobs(runtime, job.result_sha256, job.source.sha256, job.target.sha256)
    result = read_summary(path.read_bytes())
    pair = AlignedPair(
        result["transform"],
        job.source,
        job.target,
        job.options.get("target_viewpoint"),
        bool(job.options.get("ignore_file_viewpoints")),
    )
    check_disk(runtime)
    return pair, result


@asynccontextmanager
async def exported_file(
    request: Request,
    runtime: Runtime,
    caller: Caller,
    tag: str,
    export: AbstractContextManager[ExportedFile],
) -> AsyncIterator[ExportedFile | None]:
    """Write the file, count it as stored, and remove it when the context ends.

    Yields
    ------
    ExportedFile or None
        None where the caller has the file of this tag already: nothing is written.
    """
    if is_known(tag, request.headers.get("If-None-Match", "")):
        yield None
        return
    with ExitStack() as file:
        await unless_disconnected(request, runtime.export_gate.acquire(caller.tenant))
        abandoned = threading.Event()
        is_abandoned.set(abandoned)
        gone = asyncio.create_task(until_disconnected(request))
        gone.add_done_callback(lambda _: abandoned.set())
        try:
            written = await _EXPORTS.run(lambda: file.enter_context(export))
        finally:
            gone.cancel()
            runtime.export_gate.release(caller.tenant)
        try:
            await run_in_threadpool(file.enter_context, count_file(runtime, caller, written.path))
            yield written
        finally:
            await run_in_threadpool(file.close)
