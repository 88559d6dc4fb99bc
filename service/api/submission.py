"""The body of POST /v1/registrations, as a form with files or as JSON with references."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, replace
from typing import Any
from uuid import uuid4

from fastapi import Request
from pydantic import ValidationError
from starlette.concurrency import run_in_threadpool

from service.api.body import FormFields, read_multipart, read_text
from service.api.error_handlers import invalid_request
from service.api.json_body import JSON_TYPE, content_type, parse_json
from service.clouds.inputs import CLOUD_ROLES, CloudInput
from service.clouds.store import detect_format
from service.jobs.fingerprint import hash_json, hash_work
from service.jobs.model import JobRow
from service.outbound import FetchPolicy, check_callback, check_source
from service.problems import InvalidRequestError, UnsupportedContentTypeError
from service.runtime import Runtime
from service.schemas import CloudReference, Reading, RegistrationParameters, RegistrationRequest
from service.storage.blobs import Blob


@dataclass(frozen=True, slots=True)
class Submission:
    """A checked request for a registration."""

    source: CloudInput
    target: CloudInput
    parameters: RegistrationParameters

    def fingerprint(self) -> str:
        """Return a hash of everything that the caller asked for."""
        fields = set(RegistrationParameters.model_fields)
        parameters = self.parameters.model_dump(mode="json", include=fields)
        return hash_json([asdict(self.source), asdict(self.target), parameters])

    def to_job(self, tenant: str, now: float) -> JobRow:
        """Return a new job of the tenant that does what was asked for.

        `now` is the time of the database's clock.
        """
        wanted = self.parameters
        options = asdict(wanted.options)
        return JobRow(
            id=str(uuid4()),
            tenant=tenant,
            source=self.source,
            target=self.target,
            options=options,
            created_at=now,
            labels=wanted.labels,
            priority=wanted.priority,
            deadline_at=None if wanted.deadline_s is None else now + wanted.deadline_s,
            callback_url=wanted.callback_url,
            work_key=hash_work(self.source, self.target, options),
        )


async def read_submission(request: Request, runtime: Runtime, tenant: str) -> Submission:
    """Read and check the body; its files are blobs afterwards, not decoded.

    Raises
    ------
    UnsupportedContentTypeError
        The body is neither a form nor JSON.
    MalformedBodyError, BodyTooLargeError
        The body cannot be read.
    InvalidRequestError, UnknownFormatError, UnknownCloudError, AddressRefusedError
        The body asks for something impossible or forbidden.
    """
    kind = content_type(request)
    if kind == "multipart/form-data":
        submission = await read_multipart(
            request,
            runtime.blobs,
            runtime.settings.max_body_bytes,
            lambda form: _parse_form(form, runtime, tenant),
        )
    elif kind == JSON_TYPE:
        text = await read_text(request)
        submission = await run_in_threadpool(_parse_json, text, runtime, tenant)
    else:
        raise UnsupportedContentTypeError(
            "Send multipart/form-data with the files source and target, or application/json with "
            "their URLs.",
            headers={"Accept-Post": "multipart/form-data, application/json"},
        )
    callback_url = submission.parameters.callback_url
    if callback_url is not None:  # it asks the kernel for the addresses of this machine
        await run_in_threadpool(check_callback, callback_url, runtime.settings)
    return submission


def _parse_json(body: bytes, runtime: Runtime, tenant: str) -> Submission:
    wanted = parse_json(body, RegistrationRequest)
    clouds = {
        role: _with_read_options(
            _resolve_reference(getattr(wanted, role), runtime, tenant),
            getattr(wanted.reading, role),
        )
        for role in CLOUD_ROLES
    }
    return Submission(**clouds, parameters=wanted)


def _parse_form(form: FormFields, runtime: Runtime, tenant: str) -> Submission:
    clouds = {role: form.pop(role, None) for role in CLOUD_ROLES}
    parameters = _parse_parameters(form)
    inputs = {
        role: _resolve_form_cloud(role, cloud, getattr(parameters.reading, role), runtime, tenant)
        for role, cloud in clouds.items()
    }
    return Submission(**inputs, parameters=parameters)


def _parse_parameters(form: FormFields) -> RegistrationParameters:
    fields = {name: _parse_field(name, content) for name, content in form.items()}
    try:
        # strict validation takes objects and lists from JSON text only, hence the dump
        return RegistrationParameters.model_validate_json(json.dumps(fields))
    except ValidationError as error:
        raise invalid_request(error) from None


def _parse_field(name: str, content: Blob | str) -> Any:
    if isinstance(content, Blob):
        raise InvalidRequestError("The form has a file other than source and target.")
    if name == "callback_url":
        return content
    try:
        return json.loads(content)
    except (ValueError, RecursionError):
        where = name if name in RegistrationParameters.model_fields else "a field of the form"
        raise InvalidRequestError(f"{where}: expected JSON.") from None


def _resolve_form_cloud(
    role: str, content: Blob | str | None, reading: Reading, runtime: Runtime, tenant: str
) -> CloudInput:
    """Return the cloud of a form's part: a file, or JSON that refers to a cloud."""
    if content is None:
        raise InvalidRequestError(f"{role}: expected a file; send it as -F {role}=@scan.ply.")
    if isinstance(content, Blob):
        detect_format(role, content, runtime.blobs, reading.format)
        return _with_read_options(CloudInput(content.sha256, content.size), reading)
    try:
        reference = CloudReference.model_validate_json(content)
    except ValidationError as error:
        raise invalid_request(error, role) from None
    return _with_read_options(_resolve_reference(reference, runtime, tenant), reading)


def _resolve_reference(reference: CloudReference, runtime: Runtime, tenant: str) -> CloudInput:
    if reference.cloud is not None:
        return runtime.clouds.use(tenant, reference.cloud)
    assert reference.url is not None  # noqa: S101
    check_source(reference.url, FetchPolicy.of(runtime.settings))
    return CloudInput(url=reference.url)


def _with_read_options(cloud: CloudInput, reading: Reading) -> CloudInput:
    return replace(cloud, reading=cloud.reading | reading.model_dump(exclude_none=True))
