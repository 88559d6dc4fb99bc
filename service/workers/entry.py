"""Where a child process begins."""

from __future__ import annotations

from multiprocessing.connection import Connection


def stand_by(connection: Connection) -> None:
    """Wait for the one task of this process, then perform it."""
    # imported here alone: the service process, which names this function as the child's target,
    # must not load the kernels; the forkserver has loaded them already
    from service.workers import child_main

    child_main.stand_by(connection)
