"""Submissions: forms and JSON ask for the same things, and are checked in the same way."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from service.api.submission import Submission, read_submission
from service.clouds.inputs import CloudInput
from service.formats import UnknownFormatError
from service.problems import (
    InvalidRequestError,
    MalformedBodyError,
    ServiceError,
    UnknownCloudError,
    UnsupportedContentTypeError,
)
from service.schemas import RegistrationParameters
from tests.factories.api import FORM_TYPE, XYZ, form, idle_runtime, part, request_of

TENANT, NOW = "lab", 1e9
JSON_TYPE = {"Content-Type": "application/json; charset=utf-8"}
FILES = (part("source", XYZ, filename="a"), part("target", XYZ + b"1 1 1\n", filename="b"))
BY_ID = {"source": {"cloud": "door"}, "target": {"cloud": "door"}}


def read(root: Path, body: bytes, headers: dict[str, str]) -> Submission:
    """The submission of a tenant that has stored the cloud `door`."""

    async def run() -> Submission:
        with idle_runtime(root) as runtime:
            runtime.clouds.put(TENANT, "door", runtime.blobs.put([XYZ]))
            return await read_submission(request_of([body], headers), runtime, TENANT)

    return asyncio.run(run())


def read_form(root: Path, *parts: bytes) -> Submission:
    return read(root, form(*parts), FORM_TYPE)


def read_json(root: Path, body: dict[str, Any]) -> Submission:
    return read(root, json.dumps(body).encode(), JSON_TYPE)


def test_a_form_and_json_that_ask_for_the_same_are_equal(tmp_path: Path) -> None:
    said = {
        "options": {"seed": 12.0, "overlap": 1, "source_gravity": [0, 0, -1.0]},
        "labels": {"part": "door"},
        "priority": 3,
        "reading": {"source": {"scan": 1}},
    }
    said["options"]["target_gravity"] = [0, -0.0, -1]
    parts = [part(name, json.dumps(value).encode()) for name, value in (said | BY_ID).items()]
    by_form, by_json = read_form(tmp_path, *parts), read_json(tmp_path, said | BY_ID)
    assert by_form.fingerprint() == by_json.fingerprint()
    job = by_form.to_job(TENANT, NOW)
    assert job.work_key == by_json.to_job(TENANT, NOW).work_key
    assert (job.tenant, job.labels, job.priority) == (TENANT, {"part": "door"}, 3)
    assert job.options["seed"] == 12
    assert job.source.reading == {"scan": 1}


def test_uploaded_files_become_blobs(tmp_path: Path) -> None:
    submission = read_form(tmp_path, *FILES, part("reading", b'{"source": {"format": "xyz"}}'))
    assert submission.source.size == len(XYZ)
    assert submission.source.sha256 != submission.target.sha256
    assert submission.source.reading == {"format": "xyz"}
    assert submission.target.reading == {}


def test_a_file_and_a_reference_may_be_mixed(tmp_path: Path) -> None:
    submission = read_form(tmp_path, FILES[0], part("target", b'{"cloud": "door"}'))
    assert submission.target.cloud == "door"
    assert submission.source.sha256 == submission.target.sha256


REFUSED_FORMS: dict[str, tuple[list[bytes], type[Exception], str]] = {
    "no target": ([FILES[0]], InvalidRequestError, "target: expected a file"),
    "unknown field": ([*FILES, part("optoins", b"{}")], InvalidRequestError, "mean 'options'"),
    "third file": ([*FILES, part("map", b"", filename="c")], InvalidRequestError, "a file other"),
    "no JSON": (
        [*FILES, part("options", b"{secret")],
        InvalidRequestError,
        "options: expected JSON",
    ),
    "deep JSON": ([*FILES, part("labels", b"[" * 100_000)], InvalidRequestError, "expected JSON"),
    "bad value": ([*FILES, part("priority", b'"1"')], InvalidRequestError, "/priority"),
    "empty file": ([FILES[0], part("target", b"", filename="b")], InvalidRequestError, "is empty"),
    "no cloud": (
        [FILES[0], part("target", b"\x89PNG", filename="b")],
        UnknownFormatError,
        "target",
    ),
    "unknown id": ([FILES[0], part("target", b'{"cloud": "x"}')], UnknownCloudError, "expired"),
    "bad reference": ([FILES[0], part("target", b"{}")], InvalidRequestError, "exactly one"),
}


@pytest.mark.parametrize(("parts", "error", "words"), REFUSED_FORMS.values(), ids=REFUSED_FORMS)
def test_refused_forms(
    tmp_path: Path, parts: list[bytes], error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words) as raised:
        read_form(tmp_path, *parts)
    assert "secret" not in str(raised.value)


@pytest.mark.parametrize(
    ("body", "headers", "error"),
    [
        (b"{", JSON_TYPE, MalformedBodyError),
        (b"{}", JSON_TYPE, InvalidRequestError),
        (b"[]", JSON_TYPE, InvalidRequestError),
        (b"x", {"Content-Type": "text/plain"}, UnsupportedContentTypeError),
        (b"x", {}, UnsupportedContentTypeError),
    ],
)
def test_refused_bodies(
    tmp_path: Path, body: bytes, headers: dict[str, str], error: type[ServiceError]
) -> None:
    with pytest.raises(error):
        read(tmp_path, body, headers)


def test_a_pointer_leads_to_the_mistake(tmp_path: Path) -> None:
    with pytest.raises(InvalidRequestError) as raised:
        read_json(tmp_path, BY_ID | {"options": {"source_gravity": [0, "secret", 1]}})
    (mistake,) = raised.value.members["errors"]
    assert mistake["pointer"] == "/options/source_gravity/1"
    assert "secret" not in str(raised.value)


CHANGES: list[Callable[[Submission], Submission]] = [
    lambda s: replace(s, source=replace(s.source, sha256="other")),
    lambda s: replace(s, target=replace(s.target, reading={"scan": 1})),
    lambda s: replace(s, parameters=RegistrationParameters.model_validate_json('{"priority": 1}')),
    lambda s: replace(
        s, parameters=RegistrationParameters.model_validate_json('{"options": {"seed": 1}}')
    ),
]


@pytest.mark.parametrize("change", CHANGES)
def test_the_fingerprint_covers_everything(change: Callable[[Submission], Submission]) -> None:
    cloud = CloudInput("ab", 1)
    submission = Submission(cloud, cloud, RegistrationParameters())
    assert submission.fingerprint() == replace(submission).fingerprint()
    assert submission.fingerprint() != change(submission).fingerprint()


def test_a_deadline_counts_from_acceptance() -> None:
    cloud = CloudInput("ab", 1)
    wanted = RegistrationParameters.model_validate_json('{"deadline_s": 60}')
    job = Submission(cloud, cloud, wanted).to_job(TENANT, NOW)
    assert job.deadline_at == job.created_at + 60
    assert (
        Submission(cloud, cloud, RegistrationParameters()).to_job(TENANT, NOW).deadline_at is None
    )
