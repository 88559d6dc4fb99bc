"""Models of what a caller sends."""

from __future__ import annotations

from typing import Annotated, Any, Self

from pydantic import AfterValidator, ConfigDict, Field, StringConstraints, model_validator

from mpe_core import RegistrationOptions
from service.formats import FORMATS
from service.schemas.base import StrictModel
from service.schemas.options import Options

Address = Field(max_length=8192, json_schema_extra={"format": "uri"})
FORMAT_NAMES = tuple(item.name for item in FORMATS)
LabelName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_.-]{1,64}$")]
Labels = Annotated[
    dict[LabelName, Annotated[str, StringConstraints(max_length=256, pattern=r"^[^\x00]*$")]],
    Field(max_length=16, json_schema_extra={"additionalProperties": False}),
]


def _known_format(name: str) -> str:
    if name not in FORMAT_NAMES:
        raise ValueError(f"expected one of {', '.join(FORMAT_NAMES)}")
    return name


FormatName = Annotated[
    str, AfterValidator(_known_format), Field(json_schema_extra={"enum": list(FORMAT_NAMES)})
]


def _only(name: str) -> dict[str, Any]:
    """Return the JSON schema of an object with one of `cloud` and `url`, the other null."""
    kinds = {other: {"type": "string" if other == name else "null"} for other in ("cloud", "url")}
    return {"required": [name], "properties": kinds}


class CloudReference(StrictModel):
    """Reference to a stored cloud (`cloud`) or to a file to fetch (`url`); exactly one of them."""

    model_config = ConfigDict(json_schema_extra={"oneOf": [_only("cloud"), _only("url")]})

    cloud: str | None = Field(None, max_length=64, description="Id of a stored cloud.")
    url: Annotated[str, Address, Field(pattern="^(https?|s3)://")] | None = Field(
        None,
        description="http or https URL of a public host, or s3://bucket/key, if the settings "
        "of the service allow it. Responses never repeat its query.",
        examples=["https://scans.example.org/door-2.ply"],
    )

    @model_validator(mode="after")
    def _either(self) -> Self:
        if (self.cloud is None) == (self.url is None):
            raise ValueError("expected exactly one of cloud and url")
        return self


class AnnouncedFile(StrictModel):
    """A file that its owner is about to send to the store of the service directly."""

    sha256: str = Field(pattern="^[0-9a-f]{64}$", description="SHA-256 of the file.")
    size: int = Field(ge=1, description="Length of the file in bytes.")
    format: FormatName | None = Field(
        None, description="Format of the file, where its content does not tell."
    )


class Reading(StrictModel):
    """How to decode a file, where its content does not tell."""

    format: FormatName | None = Field(
        default=None,
        description="Name of its format, one of GET /v1/formats; null: detected from the content. "
        "Only `kitti`, which has no header, needs it.",
    )
    scan: int | None = Field(
        default=None,
        ge=0,
        description="Which scan of an E57 or PTX file, counted from 0; null: all, merged. Or which "
        "of the clouds of equal size that a data set of HDF5 holds.",
    )
    surface_samples: int | None = Field(
        default=None,
        ge=0,
        le=50_000_000,
        description="Points to take from the surface of a mesh, spread evenly by area; inlier "
        "pairs number them. 0: the vertices. null: as many as vertices, at least 50,000.",
    )
    weights: Annotated[str, StringConstraints(pattern=r"^[^\x00]{1,256}$")] | None = Field(
        default=None,
        description="Name of the per-point attribute with the weight of each point, a number of 0 "
        "or more; points of weight 0 do not affect the pose. Any method uses it. For PLY, PCD, "
        "LAS, LAZ, text with named columns, NPY with fields, NPZ. null: equal weights.",
    )
    array: Annotated[str, StringConstraints(pattern=r"^[^\x00]{1,256}$")] | None = Field(
        default=None,
        description="Name of the array of points in a file of several arrays, HDF5, MATLAB or NPZ, "
        "with its folder (`scan/xyz`) or without. null: the one called points, xyz and the like, "
        "or the only one.",
    )
    columns: int | None = Field(
        default=None,
        ge=3,
        le=8,
        description="Columns of float32 in each row of the format `kitti`: nuScenes has 5. "
        "null: 4, x, y, z and intensity.",
    )


class Readings(StrictModel):
    """How to decode the two files."""

    source: Reading = Field(default=Reading(), description="How to decode the source.")
    target: Reading = Field(default=Reading(), description="How to decode the target.")


class RegistrationParameters(StrictModel):
    """Parameters of a registration beside its two clouds."""

    options: Options = Field(default_factory=RegistrationOptions, description="How to register.")
    reading: Readings = Field(
        default=Readings(),
        description="How to decode the files, where their content does not tell.",
        examples=[{"source": {"format": "kitti"}, "target": {"surface_samples": 20000}}],
    )
    labels: Labels = Field(
        default_factory=dict,
        description="Up to 16 name-value pairs of the caller; the list can be filtered by them.",
        examples=[{"part": "door-2"}],
    )
    priority: int = Field(
        0,
        ge=-100,
        le=100,
        description="Waiting registrations of a tenant start in order of priority, highest first.",
    )
    deadline_s: float | None = Field(
        None,
        gt=0,
        le=604_800,
        description="Time after acceptance at which the service gives up, in seconds.",
    )
    callback_url: Annotated[str, Address, Field(pattern="^https?://")] | None = Field(
        None,
        description="URL that receives a signed POST when the registration has ended; http or "
        "https, on a host that MPE_WEBHOOK_HOSTS lists.",
    )


class RegistrationRequest(RegistrationParameters):
    """A registration of two clouds that are stored or can be fetched."""

    source: CloudReference = Field(description="The cloud that is moved.")
    target: CloudReference = Field(description="The cloud that stays.")


def describe_options() -> dict[str, dict[str, Any]]:
    """Return the JSON schema of each registration option, by name."""
    definitions = RegistrationParameters.model_json_schema()["$defs"]
    properties: dict[str, dict[str, Any]] = definitions[RegistrationOptions.__name__]["properties"]
    return properties
