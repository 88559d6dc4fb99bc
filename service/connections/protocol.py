"""uvicorn's HTTP/1.1 protocol with limits: time for a head, a body and a response to move.

uvicorn ends idle connections after a response, and no others.
"""

from __future__ import annotations

import asyncio
import enum
import time
from collections.abc import Callable
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any

import h11
import uvicorn
from starlette.types import ASGIApp
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.server import ServerState

from service.connections.probe import PROBE, answer_probe, is_probe
from service.connections.refusal import refusal
from service.connections.strict_connection import StrictConnection

MAX_STEP_S, MIN_STEP_S = 0.002, 0.0005
"""Bounds of the time that one step of parsing should take; steps are halved or doubled."""
MIN_STEP_BYTES, MAX_STEP_BYTES = 256, 64 * 1024
MIN_BODY_BYTES_PER_S = 50
"""Bytes per second below which a body counts as stalled."""


@dataclass(frozen=True, slots=True)
class Timeouts:
    """Time limits of a connection, in seconds."""

    head_s: float
    """From the first byte of a request, or the beginning of the connection, to its last header."""
    stall_s: float
    """Without progress of a request's body, or of a response that the caller does not read."""


class GuardedConfig(uvicorn.Config):
    """A uvicorn configuration with the time limits of its connections.

    `liveness` answers probes, and waits for nothing; None: the application answers them.
    """

    def __init__(
        self,
        app: ASGIApp,
        *,
        timeouts: Timeouts,
        liveness: ASGIApp | None = None,
        **options: Any,
    ) -> None:
        super().__init__(app, http=GuardedProtocol, ws="none", **options)
        self.timeouts = timeouts
        self.liveness = liveness


class Phase(enum.Enum):
    """What a connection waits for, as far as there is a limit."""

    HEAD = enum.auto()
    BODY = enum.auto()
    FLUSH = enum.auto()
    """The last bytes before it closes."""


class GuardedProtocol(H11Protocol):
    """One connection; `on_lost` is called when it has ended."""

    def __init__(
        self,
        config: GuardedConfig,
        server_state: ServerState,
        app_state: dict[str, Any],
        _loop: asyncio.AbstractEventLoop | None = None,
    ) -> None:
        super().__init__(config, server_state, app_state, _loop)
        self.conn: StrictConnection = StrictConnection()
        self.on_lost: Callable[[], None] = lambda: None
        self._timeouts = config.timeouts
        self._liveness = config.liveness
        self._may_answer = False
        self._has_answered = False
        self._phase: tuple[Phase, object] | None = None
        self._phase_timer: asyncio.TimerHandle | None = None
        self._write_timer: asyncio.TimerHandle | None = None
        self._window_bytes = 0
        self._slow_windows = 0
        self._pending = bytearray()
        self._step_bytes = MIN_STEP_BYTES * 16
        self._has_ended = False
        self.has_begun = False

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin to wait for a request."""
        self.has_begun = True
        super().connection_made(transport)
        self._watch()

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop all timers and let the connection be forgotten."""
        for timer in (self._phase_timer, self._write_timer):
            if timer is not None:
                timer.cancel()
        self._unset_keepalive_if_required()
        self._pending.clear()
        super().connection_lost(exc)
        self.on_lost()

    def data_received(self, data: bytes) -> None:
        """Parse what has come, in steps between which other connections get their turn."""
        self._window_bytes += len(data)
        is_waiting = bool(self._pending)
        self._pending += data
        if not is_waiting:
            self._parse_step()

    def eof_received(self) -> bool | None:  # type: ignore[override]
        """Keep the connection until all that came before its end is parsed."""
        self._has_ended = True
        return bool(self._pending)

    def _parse_step(self) -> None:
        if self.transport.is_closing():
            self._pending.clear()
            self._watch()
            return
        if not self._pending:
            return
        self._may_answer = True
        piece = bytes(self._pending[: self._step_bytes])
        started = time.perf_counter()
        super().data_received(piece)
        took_s = time.perf_counter() - started
        if took_s > MAX_STEP_S:
            self._step_bytes = max(MIN_STEP_BYTES, self._step_bytes // 2)
        elif took_s < MIN_STEP_S:
            self._step_bytes = min(MAX_STEP_BYTES, self._step_bytes * 2)
        del self._pending[: len(piece)]
        if self._pending:
            self.transport.pause_reading()
            self.loop.call_soon(self._parse_step)
        elif self._has_ended:
            self.transport.close()
        elif not self.flow.read_paused:
            self.transport.resume_reading()
        self._watch()

    def handle_events(self) -> None:
        """Answer a probe at once, one in each step; begin a task for any other request."""
        if not (self._may_answer and self.conn.is_before(PROBE) and self._answer_probe()):
            super().handle_events()

    def _answer_probe(self) -> bool:
        """Answer the next request if it is a probe; return whether it is."""
        if self._liveness is None or self.flow.write_paused:
            return False
        try:
            request = self.conn.peek()
        except h11.RemoteProtocolError as error:
            self.send_400_response(str(error))
            return True
        if not isinstance(request, h11.Request) or not is_probe(request):
            return False
        self._may_answer = False
        self.conn.next_event()
        self.conn.next_event()  # its end
        events = answer_probe(self._liveness, request, self.server_state.default_headers)
        self.transport.write(b"".join(self.conn.send(event) or b"" for event in events))
        if self.conn.our_state is h11.MUST_CLOSE:
            self.transport.close()
        self.on_response_complete()
        return True

    def on_response_complete(self) -> None:
        """Wait for the next request, or for the rest of a body that was answered early."""
        self._has_answered = True
        super().on_response_complete()
        self._watch()

    def timeout_keep_alive_handler(self) -> None:
        """Close an idle connection."""
        super().timeout_keep_alive_handler()
        self._watch()

    def pause_writing(self) -> None:
        """Begin to wait for the caller to read."""
        super().pause_writing()
        if self._write_timer is None:
            self._write_timer = self.loop.call_later(self._timeouts.stall_s, self.transport.abort)

    def resume_writing(self) -> None:
        """Stop waiting: the caller reads."""
        super().resume_writing()
        if self._write_timer is not None:
            self._write_timer.cancel()
            self._write_timer = None

    def send_400_response(self, msg: str) -> None:
        """Answer what is no valid request with a problem document, and close."""
        status, detail = (
            self.conn.refused_status,
            "The bytes received are no valid HTTP/1.1 request.",
        )
        if status == HTTPStatus.NOT_IMPLEMENTED:
            detail = "The service does not know the method or the transfer coding of the request."
        self._refuse(status, detail)

    def _should_upgrade(self) -> bool:
        return False

    def _watch(self) -> None:
        """Start the timer of a phase when it begins."""
        phase = self._current_phase()
        if phase == self._phase:
            return
        self._phase = phase
        if self._phase_timer is not None:
            self._phase_timer.cancel()
            self._phase_timer = None
        if phase is None:
            return
        match phase[0]:
            case Phase.HEAD:
                self._schedule(self._timeouts.head_s, self._end_head)
            case Phase.BODY:
                self._window_bytes = self._slow_windows = 0
                self._schedule(self._timeouts.stall_s / 2, self._check_body)
            case Phase.FLUSH:
                self._schedule(self._timeouts.stall_s, self.transport.abort)

    def _schedule(self, delay_s: float, action: Callable[[], None]) -> None:
        self._phase_timer = self.loop.call_later(delay_s, action)

    def _current_phase(self) -> tuple[Phase, object] | None:
        cycle = self.cycle
        if self.transport.is_closing():
            return Phase.FLUSH, None
        if cycle is not None and not cycle.response_complete:
            return (Phase.BODY, cycle) if cycle.more_body else None
        if self.conn.their_state is h11.SEND_BODY:
            return Phase.BODY, cycle
        if not self._has_answered or self.conn.trailing_data[0]:
            return Phase.HEAD, cycle
        return None  # idle between two requests: uvicorn's timer runs

    def _end_head(self) -> None:
        if self.conn.trailing_data[0]:
            self._refuse(408, f"The head did not arrive within {self._timeouts.head_s:g} s.")
        else:
            self.transport.close()
            self._watch()

    def _check_body(self) -> None:
        """Give up a body that made no progress in two windows in a row."""
        window_s = self._timeouts.stall_s / 2
        is_held_back = self.flow.read_paused or self.cycle.waiting_for_100_continue
        is_slow = self._window_bytes < MIN_BODY_BYTES_PER_S * window_s
        self._slow_windows = self._slow_windows + 1 if is_slow and not is_held_back else 0
        self._window_bytes = 0
        if self._slow_windows < 2:
            self._schedule(window_s, self._check_body)
        else:
            self._refuse(408, f"The body made no progress for {self._timeouts.stall_s:g} s.")

    def _refuse(self, status: int, detail: str) -> None:
        """Answer, unless a response has begun, and close."""
        cycle = self.cycle
        if cycle is None or cycle.response_complete or not cycle.response_started:
            self.transport.write(refusal(status, detail))
        if cycle is not None and not cycle.response_complete:
            cycle.disconnected = True
            cycle.message_event.set()
        self.transport.close()
        self._watch()
