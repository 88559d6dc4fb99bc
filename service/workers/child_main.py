"""Program of a child process: wait for one task, perform it in the sandbox, send the answer."""

from __future__ import annotations

import logging
import tempfile
from functools import partial
from multiprocessing.connection import Connection

from service.problems import (
    INTERNAL,
    JobMemoryError,
    error_document,
    is_out_of_memory,
    problem_document,
    problem_type,
)
from service.telemetry.json_logs import job_id
from service.workers.messages import Answer, Failed, Message, Problem, Ready, clip
from service.workers.pipe import send_message
from service.workers.progress import ProgressReport
from service.workers.sandbox.confinement import confine
from service.workers.sandbox.limits import (
    BUSY_NAME,
    IDLE_NAME,
    apply_limits,
    close_inherited,
    die_with_parent,
    forbid_inspection,
    forkserver_pid,
    lower_priority,
    name_process,
    raise_oom_score,
)
from service.workers.task import Task

CHILD_NICENESS = 10
"""Niceness of a child with a task, so that the API answers first
(docs/tuning.md, service.workers)."""

log = logging.getLogger(__name__)


def child_main(connection: Connection) -> None:
    """Report that this process is ready, wait for its one task, perform it."""
    die_with_parent(forkserver_pid())
    name_process(IDLE_NAME)
    _send(connection, Ready())
    try:
        task: Task = connection.recv()
    except EOFError:
        return  # the service needs it no more
    _enter_sandbox(task, connection)
    _send(connection, answer_task(task, ProgressReport(partial(_send, connection))))


def _enter_sandbox(task: Task, connection: Connection) -> None:
    environment = task.environment
    name_process(BUSY_NAME)
    apply_limits(environment.limits)
    lower_priority(CHILD_NICENESS)
    raise_oom_score()
    forbid_inspection()
    job_id.set(environment.job_id)
    tempfile.tempdir = str(environment.scratch)
    close_inherited(connection.fileno())
    confine(
        task.readable,
        [environment.scratch],
        network=task.uses_network,
        is_required=environment.requires_sandbox,
    )


def answer_task(task: Task, report: ProgressReport) -> Answer:
    """Perform the task; whatever it raises becomes a Failed."""
    try:
        return task.perform(report)
    except Exception as caught:  # noqa: BLE001
        error: Exception = caught
    if is_out_of_memory(error):
        error = JobMemoryError.beyond(task.environment.limits.memory_bytes)
    if problem_type(error) is INTERNAL:
        log.error("unexpected error in a worker", exc_info=error)
        document = problem_document(INTERNAL, "The worker failed; the error was logged.")
    else:
        document = error_document(error)
    return Failed(Problem(**document | {"detail": clip(document["detail"])}), report.timing)


def _send(connection: Connection, message: Message) -> None:
    """Send a message; end this process when nobody listens any more."""
    try:
        send_message(connection, message)
    except ConnectionError:
        raise SystemExit from None
