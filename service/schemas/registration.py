"""Models of a registration, its events and its webhook deliveries."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any

from pydantic import ConfigDict, Field

from service.jobs.model import DeliveryStatus, JobStatus
from service.schemas.base import Problem, RedactedUrl, ResponseModel
from service.schemas.result import Result

Stage = Annotated[
    str,
    Field(
        description="What it is doing: queued, fetch, decode, prepare, search, refine, inliers or "
        "finished; later releases may add stages."
    ),
]
"""Stage of a registration; a plain string, so that a new stage breaks no client."""

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
    "confidence": 0.98,
    "warnings": ["2 rows of the source were ignored: they hold NaN or infinity"],
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


class Progress(ResponseModel):
    """How far a registration has come."""

    stage: Stage
    fraction: float = Field(ge=0, le=1, description="Fraction of the work that is done, in [0, 1].")
    needs_label: str | None = Field(
        None,
        description="Label that its worker must have; `labels` of `/v1/capacity` counts those that "
        "have it. null: any worker will do.",
    )


class Event(ResponseModel):
    """State of a registration after one change."""

    at: datetime = Field(description="Time of the change (UTC).")
    status: JobStatus
    stage: Stage
    fraction: float = Field(ge=0, le=1, description="Fraction of the work that is done, in [0, 1].")


class CloudInfo(ResponseModel):
    """Where a cloud comes from and how it is decoded."""

    sha256: str | None = Field(description="SHA-256 of the file; null until it is fetched.")
    size: int | None = Field(description="Size of the file in bytes; null until it is fetched.")
    url: RedactedUrl | None = Field(
        description="URL that it is fetched from, without its query, which may hold a signature; "
        "null for an uploaded or stored cloud."
    )
    cloud: str | None = Field(description="Id of the stored cloud; null if it is not one.")
    reading: dict[str, Any] = Field(description="How the file is decoded, as the request says.")


class Timing(ResponseModel):
    """Duration of each stage; null until it is known. Later releases may add stages."""

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


class JobSummary(ResponseModel):
    """A registration without its result."""

    id: str = Field(description="Id of the registration.")
    status: JobStatus = Field(description="queued, running, succeeded, failed or cancelled.")
    created_at: datetime = Field(description="Time of acceptance (UTC).")
    started_at: datetime | None = Field(description="Start of the last attempt (UTC).")
    finished_at: datetime | None = Field(description="Time of the end (UTC).")
    attempt: int = Field(ge=0, description="Number of the last attempt; 0 before the first.")
    progress: Progress
    source: CloudInfo
    target: CloudInfo
    options: dict[str, Any] = Field(description="Every option, defaults filled in.")
    labels: dict[str, str] = Field(description="Labels of the request.")
    priority: int = Field(description="Priority of the request.")
    deadline_at: datetime | None = Field(
        description="Time at which the service stops working on it (UTC)."
    )
    callback_url: RedactedUrl | None = Field(
        description="callback_url of the request, without its query, which may hold a secret."
    )
    cached: bool = Field(description="Whether the result is reused from an equal registration.")
    result_expires_at: datetime | None = Field(
        description="Time at which result and clouds are deleted (UTC); null until it has ended."
    )
    expires_at: datetime | None = Field(
        description="Time at which the registration is deleted (UTC); null until it has ended."
    )
    timing: Timing
    confidence: float | None = Field(
        None, description="That of the result, in [0, 1]; null until there is one."
    )
    warnings: list[str] = Field(
        description="Oddities of the input or the result, in words. Kept for one release: "
        "`result.warnings` has them with codes."
    )
    error: Problem | None = Field(description="Why it failed; null unless it did.")


class Job(JobSummary):
    """A registration with its result."""

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE]})

    result: Result | None = Field(description="The pose; null unless the registration succeeded.")


class JobPage(ResponseModel):
    """One page of registrations, newest first."""

    items: list[JobSummary]
    next_cursor: str | None = Field(
        description="Value of `cursor` for the next page; null on the last page."
    )


class DeliveryAttempt(ResponseModel):
    """One request to the callback_url."""

    at: datetime = Field(description="Time of the request (UTC).")
    status_code: int | None = Field(
        description="HTTP status of the response; null if there was none."
    )
    error: str | None = Field(description="Why there was no response; null if there was one.")


class Delivery(ResponseModel):
    """A webhook message to the callback_url of a registration."""

    id: str = Field(description="Id of the message, the same in every try (Webhook-Id).")
    status: DeliveryStatus
    created_at: datetime = Field(description="Time at which it was scheduled (UTC).")
    next_at: datetime | None = Field(
        description="Time of the next try (UTC); null if there is none."
    )
    tries: list[DeliveryAttempt]


class DeliveryList(ResponseModel):
    """Webhook messages of a registration, oldest first."""

    items: list[Delivery]
