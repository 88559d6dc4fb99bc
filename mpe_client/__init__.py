"""Client of the registration service: submit, wait, fetch; blocking and asynchronous.

It needs httpx alone: neither `mpe_core` nor the service is imported.
"""

from importlib.metadata import version

from mpe_client.async_client import AsyncClient
from mpe_client.client import Client, align
from mpe_client.errors import (
    ClientError,
    InvalidResponseError,
    ProblemError,
    RegistrationCancelledError,
    RegistrationFailedError,
    UnreachableError,
    WaitTimeoutError,
)
from mpe_client.inputs import CloudSource, StoredCloud
from mpe_client.models import (
    Cloud,
    CloudInfo,
    Deviation,
    InlierList,
    InlierSummary,
    Job,
    JobPage,
    JobSummary,
    Percentile,
    Problem,
    Progress,
    Result,
    ResultWarning,
    Rotation,
    ToleranceShare,
)
from mpe_client.parameters import Options, Reading, Readings, Submission
from mpe_client.retry import Patience

__version__ = version("mpe")

__all__ = [
    "AsyncClient",
    "Client",
    "ClientError",
    "Cloud",
    "CloudInfo",
    "CloudSource",
    "Deviation",
    "InlierList",
    "InlierSummary",
    "InvalidResponseError",
    "Job",
    "JobPage",
    "JobSummary",
    "Options",
    "Patience",
    "Percentile",
    "Problem",
    "ProblemError",
    "Progress",
    "Reading",
    "Readings",
    "RegistrationCancelledError",
    "RegistrationFailedError",
    "Result",
    "ResultWarning",
    "Rotation",
    "StoredCloud",
    "Submission",
    "ToleranceShare",
    "UnreachableError",
    "WaitTimeoutError",
    "align",
]
