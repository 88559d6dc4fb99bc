"""One task of an attempt: runs in a child process of its own and reports through a pipe."""

from __future__ import annotations

import io
import json
import logging
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, replace
from multiprocessing.connection import Connection
from typing import Any

import numba
import numpy as np

from mpe_core import Registration, RegistrationOptions, register
from service.clouds.inputs import CloudInput
from service.formats import CloudFileError, DecodedCloud, read_points
from service.jobs.model import Outcome
from service.problems import INTERNAL, JobMemoryError, problem_document, problem_type
from service.schemas.serialize_result import inlier_array, render_result
from service.storage.blobs import Blob, BlobStore
from service.storage.decoded_cache import DecodedCache
from service.telemetry.json_logs import job_id
from service.workers.fetch_inputs import fetched
from service.workers.sandbox.limits import (
    BUSY_NAME,
    IDLE_NAME,
    apply_limits,
    die_with_parent,
    forkserver_pid,
    lower_priority,
    name_process,
)
from service.workers.sandbox.seccomp import drop_network
from service.workers.task import FetchTask, Task

Report = Callable[[str, float], None]
PROGRESS_EVERY_S = 0.2
READING_SHARE = 0.1
"""Share of an attempt's progress that stands for fetching and decoding."""
WORKER_NICENESS = 10
"""The API answers first. 64 clients on two cores that had other work: 99 % of the submissions took
at most 111 to 135 ms with niceness 0 of the worker's session, 55 to 84 ms with this."""

log = logging.getLogger(__name__)


def stand_by(connection: Connection) -> None:
    """Say that this process is there, wait for its one task, perform it."""
    die_with_parent(forkserver_pid())
    name_process(IDLE_NAME)
    send(connection, {"ready": True})
    try:
        task: FetchTask | Task = connection.recv()
    except EOFError:
        return  # the service needs it no more
    run(task, connection)


def run(task: FetchTask | Task, connection: Connection) -> None:
    """Confine this process, do the work, send what came of it or the problem."""
    name_process(BUSY_NAME)
    apply_limits(task.limits)
    lower_priority(WORKER_NICENESS)
    job_id.set(task.job_id)
    tempfile.tempdir = str(task.scratch)
    if isinstance(task, Task):
        seal()
        numba.set_num_threads(min(task.threads, numba.config.NUMBA_NUM_THREADS))
    send(connection, _answer(task, _throttled(connection)))


def seal() -> None:
    """Take the network away, or say that it cannot be."""
    if not drop_network():
        log.warning("this system has no seccomp: the process that decodes files keeps its network")


def send(connection: Connection, message: dict[str, Any]) -> None:
    """Messages are JSON: the parent never unpickles what a child sends.

    Ends this process when nobody listens any more: what it does has become void.
    """
    try:
        connection.send_bytes(json.dumps(message).encode())
    except ConnectionError:
        raise SystemExit from None


def _answer(task: FetchTask | Task, report: Report) -> dict[str, Any]:
    timing: dict[str, float] = {}
    try:
        if isinstance(task, FetchTask):
            with _timed(timing, "fetch_s"):
                found = fetched(task, report)
            return {"fetched": found, "timing": timing}
        return {"outcome": asdict(perform(task, report, timing))}
    except MemoryError:
        limit = task.limits.memory_bytes / 2**20
        error: Exception = JobMemoryError(f"It needs more than the allowed {limit:.0f} MiB.")
    except Exception as caught:  # noqa: BLE001
        error = caught
    kind = problem_type(error)
    if kind is INTERNAL:
        log.error("unexpected error in a worker", exc_info=error)
        return {
            "error": problem_document(kind, "The worker failed; the error was logged."),
            "timing": timing,
        }
    return {"error": problem_document(kind, str(error)), "timing": timing}


def perform(task: Task, report: Report, timing: dict[str, float]) -> Outcome:
    """Decode, register, store the result; fills in the seconds of each stage."""
    blobs = BlobStore(task.data_dir, incoming=task.scratch)
    with _timed(timing, "decode_s"):
        report("decode", READING_SHARE / 2)
        source_cloud = _decoded("source", task.source, task, blobs)
        target_cloud = _decoded("target", task.target, task, blobs)
    found = _registered(source_cloud, target_cloud, task, report)
    timing |= {f"{stage}_s": s for stage, s in found.timing.items() if stage != "total"}
    with _timed(timing, "store_s"):
        result = blobs.put([render_result(found)])
        inliers = _stored_array(inlier_array(found.inliers), blobs)
    return Outcome(
        result_sha256=result.sha256,
        inliers_sha256=inliers.sha256,
        result_bytes=result.size + inliers.size,
        confidence=found.confidence,
        source=task.source,
        target=task.target,
        timing=timing,
        warnings=[*source_cloud.warnings, *target_cloud.warnings, *found.warnings],
    )


def _registered(
    source: DecodedCloud, target: DecodedCloud, task: Task, report: Report
) -> Registration:
    def on_progress(stage: str, fraction: float) -> None:
        report(stage, READING_SHARE + (1 - READING_SHARE) * fraction)

    options = RegistrationOptions(**task.options)
    return register(
        source.points,
        target.points,
        options,
        source_weights=source.weights,
        target_weights=target.weights,
        on_progress=on_progress,
    )


def _decoded(role: str, cloud: CloudInput, task: Task, blobs: BlobStore) -> DecodedCloud:
    assert cloud.sha256 is not None  # noqa: S101
    path = blobs.path(cloud.sha256)
    try:
        if cloud.cloud is None or cloud.reading:
            decoded = read_points(path, **cloud.reading)
        else:  # it will be referred to again
            prepared = DecodedCache(task.data_dir / "prepared")
            decoded = prepared.decoded(
                task.tenant, cloud.sha256, lambda: read_points(path), task.scratch
            )
    except CloudFileError as error:
        raise type(error)(f"{role}: {error}") from error
    return replace(decoded, warnings=tuple(f"{role}: {text}" for text in decoded.warnings))


def _stored_array(array: np.ndarray[Any, Any], blobs: BlobStore) -> Blob:
    buffer = io.BytesIO()
    np.save(buffer, array, allow_pickle=False)
    return blobs.put([buffer.getvalue()])


@contextmanager
def _timed(timing: dict[str, float], name: str) -> Iterator[None]:
    start = time.perf_counter()
    try:
        yield
    finally:
        timing[name] = time.perf_counter() - start


def _throttled(connection: Connection) -> Report:
    """Send progress at each change of stage, and otherwise at most every PROGRESS_EVERY_S."""
    last_stage, last_time = "", 0.0

    def report(stage: str, fraction: float) -> None:
        nonlocal last_stage, last_time
        now = time.monotonic()
        if stage != last_stage or now - last_time >= PROGRESS_EVERY_S:
            last_stage, last_time = stage, now
            send(connection, {"stage": stage, "fraction": min(1.0, max(0.0, fraction))})

    return report
