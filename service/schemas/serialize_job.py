"""Jobs of the store, rendered for the API and for webhooks."""

from __future__ import annotations

from service.jobs.model import JobRow, is_terminal
from service.jobs.sizes import needed_label
from service.problems import ExpiredError
from service.schemas.registration import JobSummary, Progress
from service.storage.blobs import BlobStore


def summarize_job(job: JobRow) -> JobSummary:
    """Return the API's model of a job, without its result.

    Pydantic converts times (seconds since the epoch to UTC) and redacts URLs.
    """
    same = {name: getattr(job, name) for name in JobSummary.model_fields if name != "progress"}
    label = None if is_terminal(job.status) else needed_label(job.queue)
    progress = Progress(stage=job.stage, fraction=job.fraction, needs_label=label)
    return JobSummary(**same, progress=progress)


def render_job(job: JobRow, blobs: BlobStore) -> bytes:
    """Render a job with its result as JSON.

    The worker has rendered the result already; its text is inserted unchanged.

    Raises
    ------
    ExpiredError
        The file of the result is missing in the store.
    """
    result = b"null"
    if job.result_sha256 is not None:
        try:
            result = blobs.fetch(job.result_sha256).read_bytes()
        except FileNotFoundError as error:
            raise ExpiredError(
                "The result is missing in the store; register the clouds again."
            ) from error
    return summarize_job(job).model_dump_json().encode()[:-1] + b',"result":' + result + b"}"
