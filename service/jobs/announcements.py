"""What a process tells the others on its database of each change of a job."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Self, cast, get_args

from service.jobs.model import JobQueue


@dataclass(frozen=True, slots=True)
class Announcement:
    """A change of a job, after which the row has to be read."""

    change: Literal["queued", "changed", "ended"]
    queue: JobQueue
    job_id: str

    def encode(self) -> str:
        """Return the text that is sent."""
        return f"{self.change} {self.queue} {self.job_id}"

    @classmethod
    def decode(cls, text: str) -> Self | None:
        """Read a text; None for that of another release."""
        change, _, rest = text.partition(" ")
        queue, _, job_id = rest.partition(" ")
        if change not in ("queued", "changed", "ended") or queue not in get_args(JobQueue):
            return None
        return cls(cast(Literal["queued"], change), cast(JobQueue, queue), job_id)
