"""Requests that append to uploads: a new one ends the silent one that it goes on from."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from service.problems import UploadConflictError

RELEASE_TIMEOUT_S = 5.0
"""Time that an interrupted request has to save what has arrived, in seconds."""


class _Append:
    """One request that appends."""

    def __init__(self) -> None:
        self.limit = asyncio.timeout(None)
        self.has_ended = asyncio.Event()

    def interrupt(self) -> None:
        with contextlib.suppress(RuntimeError):  # it no longer waits for bytes
            self.limit.reschedule(asyncio.get_running_loop().time())


class ActiveAppends:
    """The request that appends to each upload, of this process; for use within one event loop."""

    def __init__(self) -> None:
        self._active: dict[str, _Append] = {}

    async def interrupt(self, upload_id: str) -> None:
        """End the request that appends to the upload, if there is one, and wait until it has.

        Raises
        ------
        UploadConflictError
            It did not end in time.
        """
        active = self._active.get(upload_id)
        if active is None:
            return
        active.interrupt()
        try:
            async with asyncio.timeout(RELEASE_TIMEOUT_S):
                await active.has_ended.wait()
        except TimeoutError:
            raise UploadConflictError(
                "Another request appends to this upload; retry later."
            ) from None

    @asynccontextmanager
    async def enter(self, upload_id: str) -> AsyncIterator[asyncio.Timeout]:
        """Register the request that holds the upload's lock, until the context ends.

        Yields
        ------
        asyncio.Timeout
            The limit to wait for bytes within: it expires when the request is interrupted.
        """
        append = self._active[upload_id] = _Append()
        try:
            yield append.limit
        finally:
            del self._active[upload_id]
            append.has_ended.set()
