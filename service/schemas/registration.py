"""A registration as the API shows it, and what happens to it."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any

from pydantic import ConfigDict, Field

from service.jobs.model import DeliveryStatus, JobStatus
from service.schemas.base import Document, Problem
from service.schemas.result import Result

Stage = Annotated[
    str,
    Field(
        description="What is being done: queued, fetch, decode, prepare, search, refine, inliers, "
        "finished; later releases may add stages."
    ),
]
EXAMPLE: dict[str, Any] = {
    "id": "0f8c1f0e-6a55-4a0b-9d53-0d9a0a1f7a11",
    "status": "succeeded",
    "created_at": "2026-01-05T09:30:00.000000Z",
    "started_at": "2026-01-05T09:30:00.004000Z",
    "finished_at": "2026-01-05T09:30:00.350000Z",
    "attempt": 1,
    "progress": {"stage": "finished", "fraction": 1.0},
    "source": {"sha256": "b1ac", "size": 431508, "url": None, "cloud": None},
    "target": {"sha256": "9f3e", "size": 431508, "url": None, "cloud": "door"},
    "options": {"method": "mpl", "seed": 0},
    "labels": {"part": "door-2"},
    "priority": 0,
    "deadline_at": None,
    "callback_url": None,
    "cached": False,
    "result_expires_at": "2026-01-12T09:30:00.350000Z",
    "expires_at": "2026-02-04T09:30:00.350000Z",
    "timing": {"queued_s": 0.004, "decode_s": 0.06, "search_s": 0.1, "total_s": 0.35},
    "warnings": ["source: 2 rows with NaN or infinity were left out"],
    "error": None,
    "result": {
        "transform": [[0, -1, 0, 0.25], [1, 0, 0, -0.5], [0, 0, 1, 0], [0, 0, 0, 1]],
        "rotation": {
            "quaternion_xyzw": [0, 0, 0.7071067811865476, 0.7071067811865476],
            "angle_deg": 90,
        },
        "translation": [0.25, -0.5, 0],
        "overlap": 0.91,
        "rmse": 0.0004,
        "energy": -0.93,
        "confidence": 0.98,
        "accepted": True,
        "ambiguous": False,
        "alternatives": [],
        "covariance": [[1e-8 if row == column else 0 for column in range(6)] for row in range(6)],
        "free_directions": [],
        "converged": True,
        "iterations": 12,
        "inliers": {"count": 2, "ratio": 0.91, "threshold": 0.001, "pairs": [[0, 7], [1, 3]]},
    },
}


class Progress(Document):
    """How far the registration is."""

    stage: Stage
    fraction: float = Field(ge=0, le=1, description="Share of the whole that is done, in [0, 1].")


class Event(Document):
    """A registration as it was after one change."""

    at: datetime = Field(description="When it changed (UTC).")
    status: JobStatus
    stage: Stage
    fraction: float = Field(ge=0, le=1, description="Share of the whole that is done, in [0, 1].")


class CloudInfo(Document):
    """Where a cloud came from."""

    sha256: str | None = Field(description="Hash of the file, once the service has it.")
    size: int | None = Field(description="Length of the file in bytes, once the service has it.")
    url: str | None = Field(
        description="Address that it is fetched from, if any; without its query, which may hold a "
        "signature."
    )
    cloud: str | None = Field(description="Id of the stored cloud that it is, if any.")
    reading: dict[str, Any] = Field(description="How it is read, as far as that was said.")


class Timing(Document):
    """Seconds spent, each null until known; later releases may add stages."""

    model_config = ConfigDict(extra="allow")

    queued_s: float | None = Field(None, description="Waiting for a worker, in seconds.")
    fetch_s: float | None = Field(None, description="Fetching URLs, in seconds.")
    decode_s: float | None = Field(None, description="Reading the files, in seconds.")
    prepare_s: float | None = Field(None, description="Checking and sampling, in seconds.")
    search_s: float | None = Field(None, description="Search for the pose, in seconds.")
    refine_s: float | None = Field(None, description="Refinement of the pose, in seconds.")
    inliers_s: float | None = Field(None, description="Inliers and confidence, in seconds.")
    store_s: float | None = Field(None, description="Writing the result, in seconds.")
    total_s: float | None = Field(None, description="From acceptance to the end, in seconds.")


class JobSummary(Document):
    """A registration without its result."""

    id: str = Field(description="Name of the registration.")
    status: JobStatus = Field(description="queued, running, or how it ended.")
    created_at: datetime = Field(description="When it was accepted (UTC).")
    started_at: datetime | None = Field(description="When the last attempt began (UTC).")
    finished_at: datetime | None = Field(description="When it ended (UTC).")
    attempt: int = Field(ge=0, description="Number of the last attempt; 0 before the first.")
    progress: Progress
    source: CloudInfo
    target: CloudInfo
    options: dict[str, Any] = Field(description="Every option, defaults filled in.")
    labels: dict[str, str] = Field(description="As the caller gave them.")
    priority: int = Field(description="As the caller gave it.")
    deadline_at: datetime | None = Field(description="When it is given up (UTC).")
    callback_url: str | None = Field(
        description="As the caller gave it, without its query: that may hold a secret."
    )
    cached: bool = Field(description="Whether the result is that of the same work done before.")
    result_expires_at: datetime | None = Field(
        description="When result and clouds are dropped (UTC); known once it has ended."
    )
    expires_at: datetime | None = Field(
        description="When the registration itself is dropped (UTC); known once it has ended."
    )
    timing: Timing
    warnings: list[str] = Field(description="What was odd about the input or the result.")
    error: Problem | None = Field(description="Why it failed.")


class Job(JobSummary):
    """A registration."""

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE]})

    result: Result | None = Field(description="The pose, once the registration has succeeded.")


class JobPage(Document):
    """Registrations, newest first."""

    items: list[JobSummary]
    next_cursor: str | None = Field(description="Give it as `cursor` for the next page.")


class Try(Document):
    """One call."""

    at: datetime = Field(description="When it was made (UTC).")
    status_code: int | None = Field(description="HTTP status of the answer; null: none came.")
    error: str | None = Field(description="Why no answer came.")


class Delivery(Document):
    """A message to the callback_url of a registration."""

    id: str = Field(description="Name of the message; the same in each try (Webhook-Id).")
    status: DeliveryStatus
    created_at: datetime = Field(description="When it was planned (UTC).")
    next_at: datetime | None = Field(description="When it is tried next (UTC).")
    tries: list[Try]


class DeliveryList(Document):
    """The messages of a registration, oldest first."""

    items: list[Delivery]
