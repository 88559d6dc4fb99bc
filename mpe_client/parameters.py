"""What a caller may ask for, as typed keywords with the names of the OpenAPI description."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import Any, Literal, TypedDict

from mpe_client.models import JobStatus

Vector = Sequence[float]


class Reading(TypedDict, total=False):
    """How to decode a file, where its content does not tell."""

    format: str | None
    scan: int | None
    array: str | None
    columns: int | None
    surface_samples: int | None
    weights: str | None


class Readings(TypedDict, total=False):
    """How to decode both files."""

    source: Reading
    target: Reading


class Options(TypedDict, total=False):
    """Options of a registration; docs/reference/options.md explains them."""

    method: Literal["mpl", "mpe"]
    field: Literal["tree", "exact"]
    search: Literal["global", "sparse"]
    sample_size: int
    overlap: float | None
    inlier_threshold: float | None
    voxel_size: float | None
    initial_transform: Any
    max_rotation_deg: float | None
    max_translation: float | None
    scale: Literal["fixed", "units", "free"] | Vector
    source_gravity: Vector | None
    target_gravity: Vector | None
    yaw_only: bool
    source_viewpoint: Vector | Sequence[Vector] | None
    target_viewpoint: Vector | Sequence[Vector] | None
    ignore_file_viewpoints: bool
    infer_viewpoints: Literal["auto", "never"]
    keep_no_data: bool
    use_color: Literal["auto", "never"]
    max_iterations: int
    seed: int


class Submission(Options, total=False):
    """Everything that a submission may say beside its two clouds."""

    reading: Readings
    labels: dict[str, str]
    priority: int
    deadline_s: float | None
    callback_url: str | None
    idempotency_key: str
    """Default: a new one, so that a request that is sent again makes no second registration."""


class Filters(TypedDict, total=False):
    """Which registrations are listed."""

    status: JobStatus
    label: str
    """Those with this label, as name:value."""
    search: str
    """Those that every word is found in: in labels, ids, URLs and hashes."""
    created_after: datetime
    created_before: datetime


def render_fields(wanted: Submission) -> dict[str, Any]:
    """Return the members of a request: options in one object, arrays as lists.

    Unknown names are options of a later release, or mistakes that the service explains.
    """
    given: dict[str, Any] = {name: as_json(value) for name, value in wanted.items()}
    given.pop("idempotency_key", None)
    own = Submission.__annotations__.keys() - Options.__annotations__.keys()
    options = {name: given.pop(name) for name in list(given) if name not in own}
    return ({"options": options} if options else {}) | given


def as_json(value: Any) -> Any:
    """Return a value as JSON knows it: arrays and their numbers by their method `tolist`."""
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, datetime):
        return value.isoformat()
    if isinstance(value, dict):
        return {name: as_json(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [as_json(item) for item in value]
    return value
