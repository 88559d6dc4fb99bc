"""The asynchronous client, for asyncio and trio."""

from __future__ import annotations

from collections.abc import AsyncIterator, Sequence
from pathlib import Path
from typing import Self, Unpack

import httpx

from mpe_client.connection import Connection
from mpe_client.core import RESUMABLE_BYTES, Core
from mpe_client.inputs import CloudSource, PathText
from mpe_client.models import Cloud, Deviation, InlierList, Job, JobSummary
from mpe_client.parameters import Filters, Submission
from mpe_client.retry import Patience
from mpe_client.session import Session
from mpe_client.transport import AsyncTransport
from mpe_client.waiting import OnProgress


class AsyncClient:
    """A service, over coroutines; close it, or use it in an `async with` statement.

    The arguments are those of `Client`.
    """

    def __init__(
        self,
        url: str | None = None,
        *,
        key: str | None = None,
        patience: Patience | None = None,
        resumable_bytes: int = RESUMABLE_BYTES,
    ) -> None:
        self._http = httpx.AsyncClient(**Connection.of(url, key).arguments)
        session = Session(AsyncTransport(self._http), patience or Patience())
        self._core = Core(session, resumable_bytes)

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    async def close(self) -> None:
        """Close the connections."""
        await self._http.aclose()

    async def align(
        self,
        source: CloudSource,
        target: CloudSource,
        *,
        on_progress: OnProgress | None = None,
        timeout_s: float | None = None,
        cancel_on_interrupt: bool = False,
        **wanted: Unpack[Submission],
    ) -> Job:
        """Submit a registration, wait for its end, and return it; as `Client.align`."""
        return await self._core.align(
            source, target, wanted, on_progress, timeout_s, cancel_on_interrupt
        )

    async def submit(
        self, source: CloudSource, target: CloudSource, **wanted: Unpack[Submission]
    ) -> Job:
        """Submit a registration and return it as it was accepted; arguments as for `align`."""
        return await self._core.submit(source, target, wanted)

    async def wait(
        self,
        job_id: str,
        *,
        on_progress: OnProgress | None = None,
        timeout_s: float | None = None,
    ) -> Job:
        """Return a registration once it has ended, however it has."""
        return await self._core.wait(job_id, on_progress, timeout_s)

    async def get(self, job_id: str) -> Job:
        """Return a registration as it is now."""
        return await self._core.get(job_id)

    def list(self, **filters: Unpack[Filters]) -> AsyncIterator[JobSummary]:
        """Yield registrations, newest first: all, or those that the filters leave."""
        return self._core.iter_jobs(filters)

    async def cancel(self, job_id: str) -> Job:
        """Cancel a registration that waits or runs; one that has ended is returned as it is."""
        return await self._core.cancel(job_id)

    async def delete(self, job_id: str) -> None:
        """Delete a registration and its result."""
        await self._core.delete(job_id)

    async def inliers(self, job_id: str) -> InlierList:
        """Return all inlier pairs."""
        return await self._core.inliers(job_id)

    async def deviation(
        self,
        job_id: str,
        *,
        tolerances: Sequence[float] = (),
        max_distance: float | None = None,
    ) -> Deviation:
        """Return statistics of the distances of the moved source from the target's surface.

        Parameters
        ----------
        tolerances
            Distances for which the share of points within them is wanted.
        max_distance
            Points farther away do not count, as they have no counterpart.
        """
        return await self._core.deviation(job_id, tolerances, max_distance)

    async def download_aligned(
        self, job_id: str, path: PathText, *, merged: bool = False, distances: bool = False
    ) -> Path:
        """Write the moved source, in the format of the suffix.

        Parameters
        ----------
        merged
            Whether the target is appended.
        distances
            Whether the distance of each point from the target is added, as a scalar field.
        """
        work = self._core.download_aligned(job_id, path, merged=merged, distances=distances)
        return await work

    async def download_report(
        self,
        job_id: str,
        path: PathText,
        *,
        unit: str | None = None,
        tolerances: Sequence[float] = (),
    ) -> Path:
        """Write the report, one HTML page; `unit` names the unit of the files."""
        work = self._core.download_report(job_id, path, unit=unit, tolerances=tolerances)
        return await work

    async def download_picture(self, job_id: str, path: PathText) -> Path:
        """Write a picture (PNG) of both clouds, before and after."""
        return await self._core.download_picture(job_id, path)

    async def upload(self, cloud: CloudSource, *, format: str | None = None) -> Cloud:
        """Store a cloud, in pieces that are sent again where the line breaks."""
        return await self._core.upload(cloud, format)

    async def delete_cloud(self, cloud_id: str) -> None:
        """Delete a stored cloud."""
        await self._core.delete_cloud(cloud_id)
