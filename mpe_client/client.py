"""The blocking client."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
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
from mpe_client.transport import BlockingTransport, run_blocking, take_next
from mpe_client.waiting import OnProgress


class Client:
    """A service, over blocking calls; close it, or use it in a `with` statement.

    Parameters
    ----------
    url
        Address of the service; default: MPE_CLIENT_URL, else http://127.0.0.1:8000.
    key
        API key; default: MPE_CLIENT_KEY, else none.
    patience
        How long a service that does not answer is tried again.
    resumable_bytes
        Size from which on files are uploaded in pieces.
    """

    def __init__(
        self,
        url: str | None = None,
        *,
        key: str | None = None,
        patience: Patience | None = None,
        resumable_bytes: int = RESUMABLE_BYTES,
    ) -> None:
        self._http = httpx.Client(**Connection.of(url, key).arguments)
        session = Session(BlockingTransport(self._http), patience or Patience())
        self._core = Core(session, resumable_bytes)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    def align(
        self,
        source: CloudSource,
        target: CloudSource,
        *,
        on_progress: OnProgress | None = None,
        timeout_s: float | None = None,
        cancel_on_interrupt: bool = False,
        **wanted: Unpack[Submission],
    ) -> Job:
        """Submit a registration, wait for its end, and return it.

        Parameters
        ----------
        source, target
            The cloud that is moved, and the one that stays: path, URL, open file, array (N, 3),
            `StoredCloud`.
        on_progress
            Called with a `Progress` at each change.
        timeout_s
            Seconds to wait; the registration goes on afterwards. None: until it ends.
        cancel_on_interrupt
            Whether Ctrl-C, or the cancellation of the task, cancels the registration too.
        **wanted
            Options of the registration, and `labels`, `reading`, `priority`, `deadline_s`,
            `callback_url`, `idempotency_key`.

        Returns
        -------
        Job
            It has succeeded; `require_result()` is its result.

        Raises
        ------
        RegistrationFailedError, RegistrationCancelledError
            It has failed, or was cancelled by somebody else.
        ProblemError
            The service refuses the request.
        WaitTimeoutError
            It has not ended within `timeout_s`.
        UnreachableError
            The service does not answer for longer than the patience.
        """
        return run_blocking(
            self._core.align(source, target, wanted, on_progress, timeout_s, cancel_on_interrupt)
        )

    def submit(self, source: CloudSource, target: CloudSource, **wanted: Unpack[Submission]) -> Job:
        """Submit a registration and return it as it was accepted; arguments as for `align`."""
        return run_blocking(self._core.submit(source, target, wanted))

    def wait(
        self,
        job_id: str,
        *,
        on_progress: OnProgress | None = None,
        timeout_s: float | None = None,
    ) -> Job:
        """Return a registration once it has ended, however it has."""
        return run_blocking(self._core.wait(job_id, on_progress, timeout_s))

    def get(self, job_id: str) -> Job:
        """Return a registration as it is now."""
        return run_blocking(self._core.get(job_id))

    def list(self, **filters: Unpack[Filters]) -> Iterator[JobSummary]:
        """Yield registrations, newest first: all, or those that the filters leave."""
        jobs = self._core.iter_jobs(filters)
        while (job := run_blocking(take_next(jobs))) is not None:
            yield job

    def cancel(self, job_id: str) -> Job:
        """Cancel a registration that waits or runs; one that has ended is returned as it is."""
        return run_blocking(self._core.cancel(job_id))

    def delete(self, job_id: str) -> None:
        """Delete a registration and its result."""
        run_blocking(self._core.delete(job_id))

    def inliers(self, job_id: str) -> InlierList:
        """Return all inlier pairs."""
        return run_blocking(self._core.inliers(job_id))

    def deviation(
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
        return run_blocking(self._core.deviation(job_id, tolerances, max_distance))

    def download_aligned(
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
        return run_blocking(work)

    def download_report(
        self,
        job_id: str,
        path: PathText,
        *,
        unit: str | None = None,
        tolerances: Sequence[float] = (),
    ) -> Path:
        """Write the report, one HTML page; `unit` names the unit of the files."""
        work = self._core.download_report(job_id, path, unit=unit, tolerances=tolerances)
        return run_blocking(work)

    def download_picture(self, job_id: str, path: PathText) -> Path:
        """Write a picture (PNG) of both clouds, before and after."""
        return run_blocking(self._core.download_picture(job_id, path))

    def upload(self, cloud: CloudSource, *, format: str | None = None) -> Cloud:
        """Store a cloud, in pieces that are sent again where the line breaks."""
        return run_blocking(self._core.upload(cloud, format))

    def delete_cloud(self, cloud_id: str) -> None:
        """Delete a stored cloud."""
        run_blocking(self._core.delete_cloud(cloud_id))


def align(
    source: CloudSource,
    target: CloudSource,
    *,
    url: str | None = None,
    key: str | None = None,
    on_progress: OnProgress | None = None,
    timeout_s: float | None = None,
    cancel_on_interrupt: bool = False,
    **wanted: Unpack[Submission],
) -> Job:
    """Align two clouds by the service at `url`; the other arguments are those of `Client.align`."""
    with Client(url, key=key) as client:
        return client.align(
            source,
            target,
            on_progress=on_progress,
            timeout_s=timeout_s,
            cancel_on_interrupt=cancel_on_interrupt,
            **wanted,
        )
