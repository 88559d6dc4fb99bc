"""What the service has and can do."""

from __future__ import annotations

from datetime import datetime
from typing import Literal

from pydantic import Field

from service.schemas.base import Document


class Cloud(Document):
    """A stored cloud; refer to it as {"cloud": id}."""

    id: str = Field(description="Name of the cloud.")
    sha256: str = Field(description="Hash of the file.")
    size: int = Field(description="Length of the file in bytes.")
    format: str = Field(description="What the file begins like; it has not been decoded.")
    created_at: datetime = Field(description="When it was stored (UTC).")
    expires_at: datetime = Field(description="When it is dropped unless it is used (UTC).")


class CloudPage(Document):
    """Clouds, newest first."""

    items: list[Cloud]
    next_cursor: str | None = Field(description="Give it as `cursor` for the next page.")


class FormatInfo(Document):
    """A format that is read."""

    name: str = Field(description="Its name.")
    title: str = Field(description="What is read of it.")
    extensions: list[str] = Field(description="Usual ends of file names; the content decides.")
    declared: bool = Field(description="Whether it is only read if `reading` names it.")
    choices: list[str] = Field(description="Fields of `reading` that apply to it.")


class FormatList(Document):
    """All formats that are read."""

    items: list[FormatInfo]


class Share(Document):
    """What the caller's tenant uses and may use; null: no limit."""

    requests_per_s: float | None = Field(description="Requests with this key, per second.")
    queued: int = Field(description="Its registrations that wait; a count.")
    queue_limit: int | None = Field(description="Its registrations that may wait; a count.")
    stored_bytes: int = Field(description="What is kept for it or arrives, in bytes.")
    stored_bytes_limit: int | None = Field(description="What may be kept for it, in bytes.")


class Capacity(Document):
    """What the service can take on."""

    workers: int = Field(description="Registrations that run at once; a count.")
    threads_per_worker: int = Field(description="Threads of one registration; a count.")
    running: int = Field(description="Registrations that run; a count.")
    free: int = Field(description="Workers that have nothing to do; a count.")
    queued: int = Field(description="Registrations that wait; a count.")
    queue_limit: int = Field(description="Registrations that may wait; a count.")
    max_body_bytes: int = Field(description="Largest request body, in bytes.")
    max_wait_s: float = Field(description="Longest wait that is granted, in seconds.")
    job_timeout_s: float = Field(description="Longest run of one attempt, in seconds.")
    job_memory_bytes: int = Field(description="Memory that one attempt may take, in bytes.")
    share: Share


class Health(Document):
    """Whether the service works."""

    status: Literal["ok"] = "ok"
