"""Pydantic models of the API; the description of a field states its unit."""

from __future__ import annotations

from service.schemas.base import (
    Problem,
    ResponseModel,
    StrictModel,
)
from service.schemas.deviation import Deviation, Percentile, ToleranceShare
from service.schemas.registration import (
    CloudInfo,
    Delivery,
    DeliveryAttempt,
    DeliveryList,
    Event,
    Job,
    JobPage,
    JobSummary,
    Progress,
    Stage,
    Timing,
)
from service.schemas.requests import (
    CloudReference,
    FormatName,
    Labels,
    Reading,
    Readings,
    RegistrationParameters,
    RegistrationRequest,
    describe_options,
)
from service.schemas.resources import (
    Capacity,
    Cloud,
    CloudPage,
    FormatInfo,
    FormatList,
    Health,
    TenantUsage,
)
from service.schemas.result import (
    MAX_INLINE_PAIRS,
    InlierList,
    InlierSummary,
    Result,
    Rotation,
)

__all__ = [
    "MAX_INLINE_PAIRS",
    "Capacity",
    "Cloud",
    "CloudInfo",
    "CloudPage",
    "CloudReference",
    "Delivery",
    "DeliveryAttempt",
    "DeliveryList",
    "Deviation",
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
    "Percentile",
    "Problem",
    "Progress",
    "Reading",
    "Readings",
    "RegistrationParameters",
    "RegistrationRequest",
    "ResponseModel",
    "Result",
    "Rotation",
    "Stage",
    "StrictModel",
    "TenantUsage",
    "Timing",
    "ToleranceShare",
    "describe_options",
]
