"""Waiting for the end of a registration: its event stream, or polling where none comes through."""

from __future__ import annotations

import time
from collections.abc import AsyncGenerator, Callable
from contextlib import aclosing
from dataclasses import dataclass, field, replace

import httpx

from mpe_client.errors import ProblemError, WaitTimeoutError
from mpe_client.models import TERMINAL, Event, Job, Progress
from mpe_client.parse import parse_json
from mpe_client.session import Session

OnProgress = Callable[[Progress], None]

STREAM_SILENCE_S = 40.0
"""Seconds without a byte after which a stream is given up; the service sends one every 15 s."""
MAX_SILENT_STREAMS = 2
"""Streams in a row that bring no event, after which the client polls."""
LONG_POLL_S = 15.0
"""Seconds for which one request waits for the end."""
POLL_PAUSE_S = 0.3
"""Seconds between two looks, or between two streams."""
MIN_TIMEOUT_S = 0.1
"""Seconds that a read may take where the wait is at its end."""


@dataclass(slots=True)
class Wait:
    """The wait for one registration."""

    session: Session
    job_id: str
    on_progress: OnProgress | None = None
    timeout_s: float | None = None
    _last_event: int = 0
    _silent_streams: int = 0
    _seen: Progress | None = None
    _began: float = field(default_factory=time.monotonic)

    async def until_ended(self) -> Job:
        """Return the registration once it has ended.

        A service that does not answer for a while, because it is restarted, is tried again; the
        stream goes on after the last event that was received.

        Raises
        ------
        WaitTimeoutError
            It has not ended within `timeout_s`.
        ProblemError, UnreachableError
            The registration is unknown, or the service does not answer.
        """
        while True:
            if self._silent_streams < MAX_SILENT_STREAMS:
                await self._follow_stream()
            job = await self._poll()
            if job.has_ended:
                return job
            if self._left_s() <= 0:
                raise WaitTimeoutError(self.job_id, self.timeout_s or 0.0)

    async def _follow_stream(self) -> None:
        """Report the events of one stream, until it ends for whatever reason."""
        self._silent_streams += 1
        try:
            async with aclosing(self._events()) as events:
                async for event in events:
                    self._silent_streams = 0
                    self._report(Progress(event.stage, event.fraction))
                    if event.status in TERMINAL:
                        return
        except (httpx.TransportError, httpx.StreamError, ProblemError):
            return  # the next request tells what is the matter

    async def _events(self) -> AsyncGenerator[Event, None]:
        session, silence_s = self._session(), min(STREAM_SILENCE_S, self._left_s())
        async with session.stream(
            "GET",
            f"/v1/registrations/{self.job_id}/events",
            headers={"Accept": "text/event-stream", "Last-Event-ID": str(self._last_event)},
            timeout=httpx.Timeout(10.0, read=max(MIN_TIMEOUT_S, silence_s)),
        ) as response:
            if not response.headers.get("Content-Type", "").startswith("text/event-stream"):
                return
            async for line in session.transport.iter_lines(response):
                name, _, value = line.partition(":")
                if name == "id":
                    self._last_event = int(value)
                elif name == "data":
                    yield parse_json(Event, value)
                if self._left_s() <= 0:
                    return

    async def _poll(self) -> Job:
        """Look at the registration; where there is no stream, wait for its end for a while."""
        has_stream = self._silent_streams < MAX_SILENT_STREAMS
        wait_s = 0 if has_stream else int(min(LONG_POLL_S, max(0.0, self._left_s())))
        response = await self._session().call(
            "GET",
            f"/v1/registrations/{self.job_id}",
            headers={"Prefer": f"wait={wait_s}"} if wait_s else {},
            timeout=LONG_POLL_S + 30.0,
        )
        job = parse_json(Job, response.content)
        self._report(job.progress)
        if not job.has_ended:
            await self.session.transport.sleep(min(POLL_PAUSE_S, max(0.0, self._left_s())))
        return job

    def _report(self, progress: Progress) -> None:
        if self.on_progress is not None and progress != self._seen:
            self._seen = progress
            self.on_progress(progress)

    def _session(self) -> Session:
        """Return the session with no more patience than the wait has time left."""
        patience = self.session.patience
        left_s = max(MIN_TIMEOUT_S, min(patience.max_s, self._left_s()))
        return replace(self.session, patience=replace(patience, max_s=left_s))

    def _left_s(self) -> float:
        if self.timeout_s is None:
            return float("inf")
        return self.timeout_s - (time.monotonic() - self._began)
