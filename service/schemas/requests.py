"""What a caller asks for; nothing unknown, nothing of the wrong kind."""

from __future__ import annotations

from typing import Annotated, Any, Self

from pydantic import AfterValidator, ConfigDict, Field, StringConstraints, model_validator

from service.formats import FORMATS
from service.schemas.options import Options, StrictModel

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
    """Schema of an object in which, of `cloud` and `url`, only this one is said."""
    kinds = {other: {"type": "string" if other == name else "null"} for other in ("cloud", "url")}
    return {"required": [name], "properties": kinds}


class CloudReference(StrictModel):
    """A cloud that the service has or fetches: either `cloud` or `url`."""

    model_config = ConfigDict(json_schema_extra={"oneOf": [_only("cloud"), _only("url")]})

    cloud: str | None = Field(None, max_length=64, description="Id of a stored cloud.")
    url: Annotated[str, Address, Field(pattern="^(https?|s3)://")] | None = Field(
        None,
        description="http or https address of the public network, or s3://bucket/key, as far as "
        "the settings allow it. Queries are not shown again.",
        examples=["https://scans.example.org/door-2.ply"],
    )

    @model_validator(mode="after")
    def _either(self) -> Self:
        if (self.cloud is None) == (self.url is None):
            raise ValueError("give either cloud or url")
        return self


class Reading(StrictModel):
    """How to read a file, where its content does not tell."""

    format: FormatName | None = Field(
        default=None,
        description="Name of its format, one of GET /v1/formats; null: by its content. Only "
        "`kitti`, which has no header, needs it.",
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
    weights: Annotated[str, StringConstraints(pattern=r"^[^\x00]{1,256}$")] | None = Field(
        default=None,
        description="Name of the attribute of the file that says how much each point counts beside "
        "the others, to any method: a number of 0 or more; points of 0 have no say in the pose. In "
        "PLY, PCD, LAS, LAZ, text with named columns, NPY with fields, NPZ. null: all count the "
        "same.",
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
    callback_url: Annotated[str, Address, Field(pattern="^https?://")] | None = Field(
        None,
        description="Called with a signed POST when the registration has ended; http or https, on "
        "a host that MPE_WEBHOOK_HOSTS names.",
    )


class RegistrationRequest(RegistrationParameters):
    """A registration of two clouds that the service can reach by itself."""

    source: CloudReference = Field(description="The cloud that is moved.")
    target: CloudReference = Field(description="The cloud that stays.")
