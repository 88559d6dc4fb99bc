"""What the client does, written once for both kinds of transport."""

from __future__ import annotations

import json
import uuid
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import httpx

from mpe_client.errors import RegistrationCancelledError, RegistrationFailedError, UnreachableError
from mpe_client.inputs import CloudSource, LocalFile, PathText, Reference, open_cloud
from mpe_client.models import Cloud, Deviation, InlierList, Job, JobPage, JobSummary
from mpe_client.parameters import Filters, Submission, as_json, render_fields
from mpe_client.parse import parse_json
from mpe_client.retry import Tries
from mpe_client.session import Session
from mpe_client.uploads import upload_resumably
from mpe_client.waiting import OnProgress, Wait

Model = TypeVar("Model")
RESUMABLE_BYTES = 32 << 20
"""Size of a file from which on it is uploaded in pieces: a broken line costs one of them."""
DOWNLOAD_S = 600.0
"""Seconds until the service begins to send a file that it writes on demand."""
_REGISTRATIONS = "/v1/registrations"


@dataclass(frozen=True, slots=True)
class Core:
    """The calls of the service, over a session."""

    session: Session
    resumable_bytes: int = RESUMABLE_BYTES

    async def submit(self, source: CloudSource, target: CloudSource, wanted: Submission) -> Job:
        """Submit a registration; the same one is never made twice."""
        fields = render_fields(wanted)
        key = wanted.get("idempotency_key") or str(uuid.uuid4())
        reading: Mapping[str, Any] = wanted.get("reading") or {}
        with ExitStack() as stack:
            clouds = {
                role: await self._make_ready(open_cloud(cloud, stack), reading.get(role) or {})
                for role, cloud in (("source", source), ("target", target))
            }
            response = await self.session.call(
                "POST",
                _REGISTRATIONS,
                lambda: _render_body(clouds, fields),
                headers={"Idempotency-Key": key},
            )
        return parse_json(Job, response.content)

    async def align(
        self,
        source: CloudSource,
        target: CloudSource,
        wanted: Submission,
        on_progress: OnProgress | None,
        timeout_s: float | None,
        is_cancelled_on_interrupt: bool,
    ) -> Job:
        """Submit, wait, and return the registration that has succeeded."""
        job = await self.submit(source, target, wanted)
        try:
            ended = await self.wait(job.id, on_progress, timeout_s)
        except BaseException as error:
            if is_cancelled_on_interrupt and not isinstance(error, Exception):
                await self.session.transport.finish(lambda: self.cancel(job.id))
            raise
        return _require_success(ended)

    async def wait(
        self, job_id: str, on_progress: OnProgress | None, timeout_s: float | None
    ) -> Job:
        """Return the registration once it has ended, however it has."""
        return await Wait(self.session, job_id, on_progress, timeout_s).until_ended()

    async def get(self, job_id: str) -> Job:
        """Return the registration as it is."""
        return await self._fetch(Job, f"{_REGISTRATIONS}/{job_id}")

    async def iter_jobs(self, filters: Filters) -> AsyncIterator[JobSummary]:
        """Yield the registrations of all pages."""
        params = as_json(dict(filters))
        while True:
            page = await self._fetch(JobPage, _REGISTRATIONS, params)
            for job in page.items:
                yield job
            if page.next_cursor is None:
                return
            params["cursor"] = page.next_cursor

    async def cancel(self, job_id: str) -> Job:
        """Cancel a registration that waits or runs; one that has ended is left as it is."""
        job = await self.get(job_id)
        if job.has_ended:
            return job
        response = await self.session.call("DELETE", f"{_REGISTRATIONS}/{job_id}")
        return job if not response.content else parse_json(Job, response.content)

    async def delete(self, job_id: str) -> None:
        """Delete a registration; one that waits or runs is cancelled before."""
        response = await self.session.call("DELETE", f"{_REGISTRATIONS}/{job_id}")
        if response.content:
            await self.session.call("DELETE", f"{_REGISTRATIONS}/{job_id}")

    async def inliers(self, job_id: str) -> InlierList:
        """Return all inlier pairs."""
        return await self._fetch(InlierList, f"{_REGISTRATIONS}/{job_id}/inliers")

    async def deviation(
        self, job_id: str, tolerances: Sequence[float], max_distance: float | None
    ) -> Deviation:
        """Return the statistics of the distances from the target."""
        limit = {} if max_distance is None else {"max_distance": max_distance}
        params = {"tolerance": list(tolerances), **limit}
        path = f"{_REGISTRATIONS}/{job_id}/deviation"
        return await self._fetch(Deviation, path, params, timeout=DOWNLOAD_S)

    async def download_aligned(
        self, job_id: str, path: PathText, *, merged: bool, distances: bool
    ) -> Path:
        """Write the moved source; the suffix of the path says the format."""
        format = Path(path).suffix.lower().lstrip(".") or "ply"
        params = {"format": format, "merged": merged, "distances": distances}
        return await self._download(job_id, "aligned", path, params)

    async def download_report(
        self, job_id: str, path: PathText, *, unit: str | None, tolerances: Sequence[float]
    ) -> Path:
        """Write the report."""
        params = {"tolerance": list(tolerances)} | ({} if unit is None else {"unit": unit})
        return await self._download(job_id, "report", path, params)

    async def download_picture(self, job_id: str, path: PathText) -> Path:
        """Write the picture before and after."""
        return await self._download(job_id, "preview.png", path, {})

    async def upload(self, cloud: CloudSource, format: str | None) -> Cloud:
        """Store a cloud."""
        with ExitStack() as stack:
            opened = open_cloud(cloud, stack)
            if not isinstance(opened, LocalFile):
                raise TypeError("expected a path, an open file or an array; a URL is not uploaded")
            cloud_id = await upload_resumably(self.session, opened, format)
        return await self._fetch(Cloud, f"/v1/clouds/{cloud_id}")

    async def delete_cloud(self, cloud_id: str) -> None:
        """Delete a stored cloud."""
        await self.session.call("DELETE", f"/v1/clouds/{cloud_id}")

    async def _make_ready(
        self, cloud: LocalFile | Reference, reading: Mapping[str, Any]
    ) -> LocalFile | Reference:
        """Upload a large file, which the submission refers to then."""
        if not isinstance(cloud, LocalFile) or cloud.size < self.resumable_bytes:
            return cloud
        return {"cloud": await upload_resumably(self.session, cloud, reading.get("format"))}

    async def _fetch(
        self, model: type[Model], path: str, params: Mapping[str, Any] | None = None, **given: Any
    ) -> Model:
        response = await self.session.call("GET", path, params=params, **given)
        return parse_json(model, response.content)

    async def _download(
        self, job_id: str, what: str, path: PathText, params: Mapping[str, Any]
    ) -> Path:
        """Write a file of a registration; it is under its name once it is whole."""
        goal = Path(path)
        part = goal.with_name(f"{goal.name}.part")
        tries = Tries(self.session.patience)
        try:
            while True:
                try:
                    await self._stream_to(part, f"{_REGISTRATIONS}/{job_id}/{what}", params)
                    return part.replace(goal)
                except httpx.TransportError as error:
                    if (pause := tries.next_pause()) is None:
                        raise UnreachableError(f"the download broke, often: {error}") from error
                await self.session.transport.sleep(pause)
        finally:
            part.unlink(missing_ok=True)

    async def _stream_to(self, path: Path, url: str, params: Mapping[str, Any]) -> None:
        async with self.session.stream("GET", url, params=params, timeout=DOWNLOAD_S) as response:
            with path.open("wb") as file:
                async for piece in self.session.transport.iter_bytes(response):
                    file.write(piece)


def _render_body(
    clouds: Mapping[str, LocalFile | Reference], fields: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the body of a submission: JSON where both clouds are references, else a form."""
    if not any(isinstance(cloud, LocalFile) for cloud in clouds.values()):
        return {"json": {**fields, **clouds}}
    text = {
        name: value if name == "callback_url" else json.dumps(value)
        for name, value in fields.items()
    }
    text |= {r: json.dumps(c) for r, c in clouds.items() if not isinstance(c, LocalFile)}
    files = {r: (c.name, c.rewind()) for r, c in clouds.items() if isinstance(c, LocalFile)}
    return {"data": text, "files": files}


def _require_success(job: Job) -> Job:
    """Return a registration that has succeeded.

    Raises
    ------
    RegistrationFailedError, RegistrationCancelledError
        It has not.
    """
    if job.status == "succeeded":
        return job
    if job.error is not None:
        raise RegistrationFailedError(job, job.error)
    raise RegistrationCancelledError(job)
