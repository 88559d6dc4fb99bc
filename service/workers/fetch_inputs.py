"""Task that fetches the clouds of a job from their URLs; it decodes nothing."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

from service.clouds.inputs import CloudInput
from service.outbound import S3_SCHEME, FetchPolicy, HttpCache, fetch
from service.outbound.errors import AddressRefusedError, FetchError
from service.workers.messages import Fetched, FetchedFile
from service.workers.progress import ProgressReport
from service.workers.task import Task


def is_fetched_once(source: CloudInput, target: CloudInput) -> bool:
    """Return whether both clouds are the file at one URL, which is fetched for the source."""
    return source.needs_fetching and target.needs_fetching and source.url == target.url


def aws_variables(*clouds: CloudInput) -> dict[str, str]:
    """Return the AWS_ variables of this process if a cloud has to be fetched from S3."""
    if not any(c.needs_fetching and str(c.url).startswith(S3_SCHEME) for c in clouds):
        return {}
    return {name: value for name, value in os.environ.items() if name.startswith("AWS_")}


@dataclass(frozen=True, slots=True)
class FetchInputs(Task):
    """Fetch those clouds of a job that need it."""

    uses_network: ClassVar[bool] = True

    source: CloudInput
    target: CloudInput
    policy: FetchPolicy
    aws_variables: dict[str, str] = field(default_factory=dict, repr=False)
    """Variables of the environment that hold credentials of S3; empty where none is needed."""

    @property
    def readable(self) -> list[Path]:
        """The tenant's HTTP cache, and the files of credentials."""
        cache = HttpCache(self.environment.data_dir, self.environment.tenant)
        files = [Path(value) for name, value in self.aws_variables.items() if "FILE" in name]
        return [cache.directory, *files]

    def output(self, role: str) -> Path:
        """Return the path that the file of a role is written to, in the scratch folder."""
        return self.environment.scratch / role

    def perform(self, report: ProgressReport) -> Fetched:
        """Fetch the clouds into the scratch folder.

        Raises
        ------
        AddressRefusedError
            A URL may not be fetched.
        FetchError
            A URL could not be fetched; the subclass says why.
        """
        os.environ.update(self.aws_variables)
        report.send("fetch", 0.0)
        with report.stage("fetch"):
            source = self._fetch_if_needed("source", self.source)
            if is_fetched_once(self.source, self.target):
                target = source
            else:
                target = self._fetch_if_needed("target", self.target)
        return Fetched(source, target, report.timing)

    def _fetch_if_needed(self, role: str, cloud: CloudInput) -> FetchedFile | None:
        if not cloud.needs_fetching:
            return None
        assert cloud.url is not None  # noqa: S101
        cache = HttpCache(self.environment.data_dir, self.environment.tenant)
        try:
            done = fetch(cloud.url, self.policy, self.output(role), cache)
        except (AddressRefusedError, FetchError) as error:
            raise type(error)(f"{role}: {error}") from error
        validators = done.validators
        return FetchedFile(
            done.key, validators.etag, validators.last_modified, is_cached=done.is_cached
        )
