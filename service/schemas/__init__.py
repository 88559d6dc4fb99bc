"""What the API takes and gives; the unit of each quantity is in its description."""

from __future__ import annotations

from service.schemas.base import (
    Document,
    Problem,
)
from service.schemas.registration import (
    CloudInfo,
    Delivery,
    DeliveryList,
    Event,
    Job,
    JobPage,
    JobSummary,
    Progress,
    Stage,
    Timing,
    Try,
)
from service.schemas.requests import (
    CloudReference,
    FormatName,
    Labels,
    Reading,
    Readings,
    RegistrationParameters,
    RegistrationRequest,
)
from service.schemas.resources import (
    Capacity,
    Cloud,
    CloudPage,
    FormatInfo,
    FormatList,
    Health,
    Share,
)
from service.schemas.result import (
    INLINE_PAIRS,
    InlierList,
    InlierSummary,
    Result,
    Rotation,
)

__all__ = [
    "INLINE_PAIRS",
    "Capacity",
    "Cloud",
    "CloudInfo",
    "CloudPage",
    "CloudReference",
    "Delivery",
    "DeliveryList",
    "Document",
    "Event",
    "FormatInfo",
    "FormatList",
    "FormatName",
    "Health",
    "InlierList",
    "InlierSummary",
    "Job",
    "JobPage",
    "JobSummary",
    "Labels",
    "Problem",
    "Progress",
    "Reading",
    "Readings",
    "RegistrationParameters",
    "RegistrationRequest",
    "Result",
    "Rotation",
    "Share",
    "Stage",
    "Timing",
    "Try",
]
