"""What the API takes and gives; the unit of each quantity is in its description."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    HttpUrl,
    StringConstraints,
    model_validator,
)

from service.formats import FORMATS
from service.jobs.deliveries import DeliveryStatus
from service.jobs.job import JobStatus
from service.options import Options, StrictModel

INLINE_PAIRS = 100_000
FORMAT_NAMES = tuple(item.name for item in FORMATS)

Stage = Annotated[
    str,
    Field(
        description="What is being done: queued, fetch, decode, prepare, search, refine, inliers, "
        "finished; later releases may add stages."
    ),
]
Row = Annotated[list[float], Field(min_length=4, max_length=4)]
Vector = Annotated[list[float], Field(min_length=3, max_length=3)]
LabelName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_.-]{1,64}$")]
Labels = Annotated[
    dict[LabelName, Annotated[str, StringConstraints(max_length=256)]], Field(max_length=16)
]
Pair = Annotated[list[int], Field(min_length=2, max_length=2)]


class CloudReference(StrictModel):
    """A cloud that the service has or fetches: either `cloud` or `url`."""

    cloud: str | None = Field(None, max_length=64, description="Id of a stored cloud.")
    url: Annotated[HttpUrl, Field(strict=False)] | None = Field(
        None,
        description="http or https address on a host that MPE_URL_HOSTS names.",
        examples=["https://scans.example.org/door-2.ply"],
    )

    @model_validator(mode="after")
    def _either(self) -> Self:
        if (self.cloud is None) == (self.url is None):
            raise ValueError("give either cloud or url")
        return self


def _known_format(name: str) -> str:
    if name not in FORMAT_NAMES:
        raise ValueError(f"expected one of {', '.join(FORMAT_NAMES)}")
    return name


class Reading(StrictModel):
    """How to read a file, where its content does not tell."""

    format: Annotated[str, AfterValidator(_known_format)] | None = Field(
        default=None,
        description="Name of its format, one of GET /v1/formats; null: by its content. Only "
        "`kitti`, which has no header, needs it.",
        json_schema_extra={"enum": [*FORMAT_NAMES, None]},
    )
    scan: int | None = Field(
        default=None,
        ge=0,
        description="Which scan of an E57 or PTX file, counted from 0; null: all, merged.",
    )
    surface_samples: int | None = Field(
        default=None,
        ge=3,
        le=50_000_000,
        description="Points to take from the surface of a mesh, spread evenly by area; "
        "null: its vertices.",
    )


class Readings(StrictModel):
    """How to read the two files."""

    source: Reading = Field(default=Reading(), description="How to read the source.")
    target: Reading = Field(default=Reading(), description="How to read the target.")


class RegistrationParameters(StrictModel):
    """What is said about a registration beside its two clouds."""

    options: Options = Field(default_factory=Options, description="How to register.")
    reading: Readings = Field(
        default=Readings(),
        description="How to read the files, where their content does not tell.",
        examples=[{"source": {"format": "kitti"}, "target": {"surface_samples": 20000}}],
    )
    labels: Labels = Field(
        default_factory=dict,
        description="Up to 16 words of the caller's own, given back and searched for in the list.",
        examples=[{"part": "door-2"}],
    )
    priority: int = Field(
        0, ge=-100, le=100, description="Among the waiting, the highest goes first; no unit."
    )
    deadline_s: float | None = Field(
        None, gt=0, le=604_800, description="Give up after this long from now, in seconds."
    )
    callback_url: Annotated[HttpUrl, Field(strict=False)] | None = Field(
        None,
        description="Called with a signed POST when the registration has ended; http or https, on "
        "a host that MPE_WEBHOOK_HOSTS names.",
    )


class RegistrationRequest(RegistrationParameters):
    """A registration of two clouds that the service can reach by itself."""

    source: CloudReference = Field(description="The cloud that is moved.")
    target: CloudReference = Field(description="The cloud that stays.")


class Document(BaseModel):
    """Base of what the API gives."""

    model_config = ConfigDict(extra="forbid")


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


class CloudInfo(Document):
    """Where a cloud came from."""

    sha256: str | None = Field(description="Hash of the file, once the service has it.")
    size: int | None = Field(description="Length of the file in bytes, once the service has it.")
    url: str | None = Field(description="Address that it is fetched from, if any.")
    cloud: str | None = Field(description="Id of the stored cloud that it is, if any.")
    reading: dict[str, Any] = Field(description="How it is read, as far as that was said.")


class Rotation(Document):
    """The rotation of the transform in other words."""

    quaternion_xyzw: Row = Field(description="Unit quaternion x, y, z, w with w >= 0; no unit.")
    angle_deg: float = Field(ge=0, le=180, description="Angle of the rotation in degrees.")


class InlierSummary(Document):
    """Pairs of points closer than the threshold at the final pose."""

    count: int = Field(ge=0, description="Number of pairs.")
    ratio: float = Field(ge=0, le=1, description="Share of the source points that are in a pair.")
    threshold: float = Field(ge=0, description="Largest distance of a pair, in the input's unit.")
    pairs: list[Pair] | None = Field(
        description="[source index, target index] of each pair, counted from 0 in the order of the "
        f"files; null above {INLINE_PAIRS:,} pairs: fetch .../inliers then."
    )


class Result(Document):
    """The pose of the source in the target's frame, and how far to trust it."""

    transform: Annotated[list[Row], Field(min_length=4, max_length=4)] = Field(
        description="4x4 rigid transform, row-major, for column vectors: "
        "x_target = R x_source + t; the last column in the input's unit."
    )
    rotation: Rotation
    translation: Vector = Field(description="t of the transform, in the input's unit.")
    overlap: float = Field(
        ge=0, le=1, description="Share of the source points with a counterpart in the target."
    )
    rmse: float = Field(
        ge=0, description="Root mean square distance of the inliers, in the input's unit."
    )
    energy: float = Field(
        description="P2 criterion of the pose, mean over the source, in [-1, 0]; no unit."
    )
    confidence: float = Field(ge=0, le=1, description="How likely the pose is right, in [0, 1].")
    converged: bool = Field(description="Whether the refinement settled before its bound.")
    iterations: int = Field(ge=0, description="Iterations of the last stage; a count.")
    inliers: InlierSummary


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


class Problem(BaseModel):
    """Problem document (RFC 9457)."""

    model_config = ConfigDict(extra="allow")

    type: str = Field(description="Stable name of the kind of problem.")
    title: str = Field(description="The kind of problem in words.")
    status: int = Field(ge=400, le=599, description="HTTP status that fits the problem.")
    detail: str = Field(description="What is wrong here, and what to do.")
    errors: list[dict[str, str]] | None = Field(
        None, description="For an invalid request: pointer and detail of each mistake."
    )


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
    callback_url: str | None = Field(description="As the caller gave it.")
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

    result: Result | None = Field(description="The pose, once the registration has succeeded.")


class JobPage(Document):
    """Registrations, newest first."""

    items: list[JobSummary]
    next_cursor: str | None = Field(description="Give it as `cursor` for the next page.")


class InlierList(Document):
    """All inlier pairs, by source index."""

    count: int = Field(ge=0, description="Number of pairs.")
    threshold: float = Field(ge=0, description="Largest distance of a pair, in the input's unit.")
    pairs: list[Pair] = Field(description="[source index, target index] of each pair.")
    distances: list[float] = Field(description="Distance of each pair, in the input's unit.")


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


class Health(Document):
    """Whether the service works."""

    status: Literal["ok"] = "ok"
