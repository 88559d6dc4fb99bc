"""What a POST to /v1/registrations asks for, whichever way it says it."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, replace
from typing import Any

from fastapi import Request
from pydantic import ValidationError
from starlette.concurrency import run_in_threadpool

from service.api.body import Fields, read_multipart, read_text
from service.api.error_handlers import invalid_request
from service.clouds.inputs import CloudInput
from service.clouds.store import detect_format
from service.jobs.fingerprint import hash_json
from service.outbound import FetchRules, check_callback, check_source
from service.problems import InvalidRequestError, MalformedBodyError, UnsupportedContentTypeError
from service.runtime import Runtime
from service.schemas import CloudReference, Reading, RegistrationParameters, RegistrationRequest
from service.storage.blobs import Blob

CLOUDS = ("source", "target")


@dataclass(frozen=True, slots=True)
class Submission:
    """A registration to be accepted."""

    source: CloudInput
    target: CloudInput
    parameters: RegistrationParameters

    def fingerprint(self) -> str:
        """Hash of all that was asked for."""
        said = self.parameters.model_dump(
            mode="json", include=set(RegistrationParameters.model_fields)
        )
        return hash_json([asdict(self.source), asdict(self.target), said])


async def read_submission(request: Request, service: Runtime, tenant: str) -> Submission:
    """Read and check the body; files are on disk afterwards, nothing is decoded."""
    content_type = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if content_type == "multipart/form-data":
        limit = service.settings.max_body_bytes
        submission = await read_multipart(
            request, service.blobs, limit, lambda form: _from_form(form, service, tenant)
        )
    elif content_type == "application/json":
        text = await read_text(request)
        submission = await run_in_threadpool(_from_json, text, service, tenant)
    else:
        raise UnsupportedContentTypeError(
            "Send multipart/form-data with the files source and target, or application/json with "
            "their URLs.",
            headers={"Accept-Post": "multipart/form-data, application/json"},
        )
    if submission.parameters.callback_url is not None:
        check_callback(submission.parameters.callback_url, service.settings)
    return submission


def _from_form(form: Fields, service: Runtime, tenant: str) -> Submission:
    files = {role: form.pop(role, None) for role in CLOUDS}
    fields: dict[str, Any] = {}
    for name, text in form.items():
        if isinstance(text, Blob):
            raise InvalidRequestError("There is a file beside source and target.")
        fields[name] = _parsed(name, text)
    try:
        parameters = RegistrationParameters.model_validate_json(json.dumps(fields))
    except ValidationError as error:
        raise invalid_request(error) from None
    clouds = {
        role: _cloud(role, file, getattr(parameters.reading, role), service, tenant)
        for role, file in files.items()
    }
    return Submission(**clouds, parameters=parameters)


def _cloud(
    role: str, field: Blob | str | None, reading: Reading, service: Runtime, tenant: str
) -> CloudInput:
    """An uploaded file, or a reference in its place."""
    if isinstance(field, Blob):
        detect_format(role, field, service.blobs, reading.format)
        return _read_as(reading, CloudInput(sha256=field.sha256, size=field.size))
    if field is None:
        raise InvalidRequestError(f"{role}: expected a file; send it as -F {role}=@scan.ply.")
    try:
        reference = CloudReference.model_validate_json(field)
        return _read_as(reading, _referred(reference, service, tenant))
    except ValidationError as error:
        raise invalid_request(error, role) from None


def _read_as(reading: Reading, cloud: CloudInput) -> CloudInput:
    return replace(cloud, reading=cloud.reading | reading.model_dump(exclude_none=True))


def _parsed(name: str, text: str) -> Any:
    if name == "callback_url":
        return text
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        where = name if name in RegistrationParameters.model_fields else "a field of the form"
        raise InvalidRequestError(f"{where}: expected JSON.") from None


def _from_json(body: bytes, service: Runtime, tenant: str) -> Submission:
    try:
        wanted = RegistrationRequest.model_validate_json(body)
    except ValidationError as error:
        if error.errors()[0]["type"] == "json_invalid":
            raise MalformedBodyError("The body is not JSON.") from None
        raise invalid_request(error) from None
    return Submission(
        source=_read_as(wanted.reading.source, _referred(wanted.source, service, tenant)),
        target=_read_as(wanted.reading.target, _referred(wanted.target, service, tenant)),
        parameters=wanted,
    )


def _referred(reference: CloudReference, service: Runtime, tenant: str) -> CloudInput:
    if reference.cloud is not None:
        return service.clouds.use(tenant, reference.cloud)
    assert reference.url is not None  # noqa: S101
    check_source(reference.url, FetchRules.of(service.settings))
    return CloudInput(url=reference.url)
