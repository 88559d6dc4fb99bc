"""Jobs as JSON: times in UTC, URLs redacted, the result as the worker has written it."""

from __future__ import annotations

import json
import random
from datetime import UTC, datetime
from pathlib import Path

import pytest

from service.clouds.inputs import CloudInput
from service.problems import ExpiredError
from service.schemas import Cloud, Event, Job
from service.schemas.serialize_job import render_job, summarize_job
from service.storage.blobs import BlobStore
from tests.factories.jobs import new_job

URL = "https://user:word@scans.example.org/door.ply?signature=secret"


def test_times_are_utc_and_exact_to_the_microsecond() -> None:
    rng = random.Random(0)
    for seconds in (0.0, 1.5, *(rng.uniform(1e9, 4e9) for _ in range(2000))):
        job = summarize_job(new_job(created_at=seconds, deadline_at=seconds))
        exact = datetime.fromtimestamp(seconds, UTC)
        assert job.created_at.utcoffset() == exact.utcoffset()
        assert abs((job.created_at - exact).total_seconds()) <= 1e-6
        assert job.deadline_at == job.created_at
    assert '"created_at":"1970-01-01T00:00:01.500000Z"' in summarize_job(
        new_job(created_at=1.5)
    ).model_dump_json(include={"created_at"})


def test_what_is_not_known_yet_is_null() -> None:
    job = summarize_job(new_job())
    assert (job.started_at, job.finished_at, job.expires_at, job.error) == (None,) * 4
    assert (job.progress.stage, job.progress.fraction) == ("queued", 0)
    assert set(job.timing.model_dump().values()) == {None}


def test_urls_are_redacted_everywhere() -> None:
    job = new_job(source=CloudInput(url=URL), target=CloudInput(url=URL), callback_url=URL)
    text = summarize_job(job).model_dump_json()
    assert text.count("https://scans.example.org/door.ply") == 3
    assert "secret" not in text
    assert "word" not in text


def test_what_later_releases_add_is_kept() -> None:
    error = {"type": "t", "title": "T", "status": 422, "detail": "d", "queued": 3}
    job = summarize_job(new_job(status="failed", error=error, timing={"polish_s": 1.0}))
    assert job.model_dump(exclude_none=True)["error"] == error
    assert job.model_dump()["timing"]["polish_s"] == 1.0


def test_the_result_is_inserted_as_it_is(tmp_path: Path) -> None:
    blobs = BlobStore(tmp_path)
    blob = blobs.put([b'{"rmse":1e-3}'])
    job = new_job(status="succeeded", result_sha256=blob.sha256)
    assert render_job(job, blobs).endswith(b',"result":{"rmse":1e-3}}')
    plain = render_job(new_job(), blobs)
    assert plain.endswith(b',"result":null}')
    assert json.loads(plain).keys() == Job.model_fields.keys()


def test_a_result_whose_file_is_missing_has_expired(tmp_path: Path) -> None:
    job = new_job(status="succeeded", result_sha256="00" * 32)
    with pytest.raises(ExpiredError, match="register the clouds again"):
        render_job(job, BlobStore(tmp_path))


def test_rows_are_read_by_their_attributes() -> None:
    """A row has more than the API tells: the tenant, for instance."""

    class Row:
        number = 3
        at = 2.0
        status = "running"
        stage = "search"
        fraction = 0.5

    assert Event.model_validate(Row()).model_dump(mode="json") == {
        "at": "1970-01-01T00:00:02Z",
        "status": "running",
        "stage": "search",
        "fraction": 0.5,
    }
    assert "tenant" not in Cloud.model_fields
