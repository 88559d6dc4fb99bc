"""Exceptions of the client."""

from __future__ import annotations

from mpe_client.models import Job, Problem


class ClientError(Exception):
    """Root of the exceptions of the client."""


class UnreachableError(ClientError):
    """The service could not be reached for as long as the client's patience allows."""


class InvalidResponseError(ClientError):
    """The response is not one of the service."""


class WaitTimeoutError(ClientError):
    """The registration has not ended within `timeout_s`; it goes on."""

    def __init__(self, job_id: str, timeout_s: float) -> None:
        super().__init__(
            f"registration {job_id} has not ended within {timeout_s:g} s; it goes on: wait for it "
            "again, or cancel it"
        )
        self.job_id = job_id


class ProblemError(ClientError):
    """The service refused a request.

    Parameters
    ----------
    problem
        Its problem document; `problem.type` is stable, `problem.detail` says what to do.
    """

    def __init__(self, problem: Problem) -> None:
        super().__init__(f"{problem.title} ({problem.status}): {problem.detail}")
        self.problem = problem


class RegistrationFailedError(ProblemError):
    """A registration has failed.

    Parameters
    ----------
    job
        The registration; its `error` is the problem.
    problem
        Why it failed.
    """

    def __init__(self, job: Job, problem: Problem) -> None:
        super().__init__(problem)
        self.job = job


class RegistrationCancelledError(ClientError):
    """A registration was cancelled while it was waited for."""

    def __init__(self, job: Job) -> None:
        super().__init__(f"registration {job.id} was cancelled")
        self.job = job
