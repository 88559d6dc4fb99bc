"""The server process: uvicorn, signals, and the drain at shutdown."""

from __future__ import annotations

import gc
import logging
import socket
import sys
import threading
from types import FrameType

import uvicorn
from fastapi import FastAPI
from uvicorn.config import STARTUP_FAILURE

from service.app import create_app
from service.auth.bind_check import check_binding
from service.connections.guard import ConnectionGuard
from service.connections.listener import Listener, bind
from service.connections.protocol import GuardedConfig, GuardedProtocol, Timeouts
from service.database.store import check_store
from service.runtime import Role, Runtime
from service.settings import Settings, load_settings, log_renamed_variables
from service.telemetry.json_logs import configure_logs
from service.workers.sandbox.confinement import check_sandbox
from service.workers.sandbox.limits import forbid_inspection

log = logging.getLogger(__name__)

CONNECTION_GRACE_S = 3
"""Seconds for open connections (event streams, long polls) to close after the workers stopped."""

GIL_SWITCH_INTERVAL_S = 0.0005
"""Interval of GIL hand-over, in seconds; Python's default of 5 ms delays the event loop while a
thread computes (docs/tuning.md)."""

GC_THRESHOLDS = (700, 10, 100)
"""Those of the garbage collector; with Python's 10 in place of 100 it looks at every object each
two to four seconds of a flood, and holds the interpreter for up to 70 ms (docs/tuning.md)."""


class DrainingServer(uvicorn.Server):
    """A uvicorn server that keeps answering while it drains: running jobs get a grace to finish."""

    def __init__(self, config: GuardedConfig, app: FastAPI, guard: ConnectionGuard) -> None:
        super().__init__(config)
        self._app = app
        self._guarded_config = config
        self._guard = guard
        self._draining = False

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start the application, then accept connections within the limits."""
        await super().startup(sockets=[])  # uvicorn itself accepts none
        config = self._guarded_config
        try:
            bound = sockets or await bind(config.host, config.port)
        except OSError as error:
            log.error("cannot listen at %s:%d: %s", config.host, config.port, error)
            await self.lifespan.shutdown()
            sys.exit(STARTUP_FAILURE)
        listener = Listener(bound, self._make_protocol, self._guard)
        self.servers.append(listener)  # type: ignore[arg-type]
        log.info("listening at %s", ", ".join(listener.addresses))
        listener.start()

    def _make_protocol(self) -> GuardedProtocol:
        return GuardedProtocol(self._guarded_config, self.server_state, self.lifespan.state)

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """Start to drain at the first signal; stop at once at the second."""
        if self._draining:
            super().handle_exit(sig, frame)
            return
        self._draining = True
        threading.Thread(target=self._drain, args=(sig, frame), daemon=True).start()

    def _drain(self, sig: int, frame: FrameType | None) -> None:
        runtime: Runtime | None = getattr(self._app.state, "runtime", None)
        if runtime is not None:
            runtime.drain()
        super().handle_exit(sig, frame)


def serve(
    settings: Settings, host: str = "127.0.0.1", port: int = 8000, role: Role = "all"
) -> None:
    """Serve until SIGTERM or SIGINT.

    Raises
    ------
    UnprotectedBindError
        Other machines could reach the address, and there are no keys.
    StoreLostError
        The job store is missing, empty or damaged.
    SandboxError
        MPE_REQUIRE_SANDBOX is set, and the kernel lacks a part of the sandbox.
    """
    check_store(settings)
    check_binding(host, settings)
    configure_logs(settings.log_level)
    log_renamed_variables()
    forbid_inspection()
    check_sandbox(is_required=settings.require_sandbox)
    sys.setswitchinterval(GIL_SWITCH_INTERVAL_S)
    app = create_app(settings, role)
    # keep the imported objects out of full collections, which would stop the event loop for 60 ms
    gc.collect()
    gc.freeze()
    gc.set_threshold(*GC_THRESHOLDS)
    config = GuardedConfig(
        app,
        timeouts=Timeouts(settings.head_timeout_s, settings.body_stall_timeout_s),
        liveness=app.state.liveness,
        host=host,
        port=port,
        server_header=False,
        log_config=None,
        timeout_keep_alive=settings.idle_timeout_s,
        timeout_graceful_shutdown=CONNECTION_GRACE_S,
    )
    guard = ConnectionGuard(settings.max_connections, settings.connections_per_address)
    DrainingServer(config, app, guard).run()


if __name__ == "__main__":
    serve(load_settings())
