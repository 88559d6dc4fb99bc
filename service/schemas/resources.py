"""Models of stored clouds, formats, capacity and health."""

from __future__ import annotations

from datetime import datetime
from typing import Literal

from pydantic import Field

from service.schemas.base import ResponseModel


class Cloud(ResponseModel):
    """A stored cloud; a registration refers to it as {"cloud": id}."""

    id: str = Field(description="Id of the cloud.")
    sha256: str = Field(description="SHA-256 of the file.")
    size: int = Field(description="Size of the file in bytes.")
    format: str = Field(
        description="Format, from the first bytes of the file or as declared; not decoded yet."
    )
    created_at: datetime = Field(description="Time at which it was stored (UTC).")
    expires_at: datetime = Field(
        description="Time at which it is deleted unless it is used before (UTC)."
    )


class CloudPage(ResponseModel):
    """One page of clouds, newest first."""

    items: list[Cloud]
    next_cursor: str | None = Field(
        description="Value of `cursor` for the next page; null on the last page."
    )


class DirectUpload(ResponseModel):
    """Where to send a file directly; then POST to /v1/clouds/presign/{id}."""

    id: str = Field(description="Id of the upload, and of the cloud that it becomes.")
    url: str = Field(description="URL to PUT the file to, without a key or other headers.")
    url_expires_at: datetime = Field(description="Time until which the PUT has to begin (UTC).")
    expires_at: datetime = Field(
        description="Time at which the upload is deleted unless it is complete before (UTC)."
    )


class SignedUrl(ResponseModel):
    """Where to GET a file directly, without a key."""

    url: str = Field(description="URL of the file.")
    url_expires_at: datetime = Field(description="Time until which the GET has to begin (UTC).")
    sha256: str = Field(description="SHA-256 of the file, to compare it with.")


class FormatInfo(ResponseModel):
    """A file format that the service reads."""

    name: str = Field(description="Name of the format.")
    title: str = Field(description="What the service reads of it.")
    extensions: list[str] = Field(
        description="Usual file extensions; the content of a file decides, not its name."
    )
    declared: bool = Field(
        description="Whether `reading` has to name the format: the content does not tell."
    )
    choices: list[str] = Field(description="Fields of `reading` that apply to it.")


class FormatList(ResponseModel):
    """All formats that the service reads."""

    items: list[FormatInfo]


class TenantUsage(ResponseModel):
    """What the caller's tenant uses, and its limits; a limit of null: none."""

    requests_per_s: float | None = Field(description="Limit of requests per second with this key.")
    queued: int = Field(description="Number of its waiting registrations.")
    queue_limit: int | None = Field(description="Limit of its waiting registrations.")
    stored_bytes: int = Field(description="Bytes stored for it or being uploaded.")
    stored_bytes_limit: int | None = Field(description="Limit of its stored bytes.")


class Capacity(ResponseModel):
    """Load and limits of the service."""

    workers: int = Field(description="Number of registrations that all services can run at once.")
    labels: dict[str, int] = Field(
        description="Of these, the number for each label that a worker has."
    )
    threads_per_worker: int = Field(description="Number of threads of one registration.")
    running: int = Field(description="Number of running registrations.")
    free: int = Field(description="Number of idle workers.")
    queued: int = Field(description="Number of waiting registrations.")
    queue_limit: int = Field(description="Limit of waiting registrations.")
    warnings: list[str] = Field(
        description="What keeps registrations waiting until somebody mends it, in words."
    )
    large_bytes: int | None = Field(
        description="Bytes of both files above which a registration needs a worker with the label "
        "`large`; null: none does."
    )
    max_body_bytes: int = Field(description="Largest request body, in bytes.")
    max_wait_s: float = Field(description="Longest `Prefer: wait`, in seconds.")
    job_timeout_s: float = Field(description="Time limit of one attempt, in seconds.")
    job_memory_bytes: int = Field(description="Memory limit of one attempt, in bytes.")
    share: TenantUsage


class Health(ResponseModel):
    """Whether the service works."""

    status: Literal["ok"] = "ok"


class Readiness(Health):
    """Whether registrations start at once."""

    warnings: list[str] = Field(
        default_factory=list,
        description="What keeps registrations waiting until somebody mends it, in words.",
    )
