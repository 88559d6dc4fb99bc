"""What a POST to /v1/registrations asks for, whichever way it says it."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import Any

from fastapi import Request
from pydantic import ValidationError
from starlette.concurrency import run_in_threadpool

from service.body import read_multipart, read_text
from service.core import Service
from service.errors import invalid_request
from service.formats import FORMATS, UnknownFormatError, sniff
from service.jobs.job import CloudInput
from service.jobs.work import fingerprint
from service.problems import InvalidRequestError, MalformedBodyError, UnsupportedContentTypeError
from service.schemas import RegistrationParameters, RegistrationRequest, UrlReference
from service.settings import Settings
from service.sources import check_address
from service.storage import Blob, BlobStore

_FORMATS = ", ".join(format.name for format in FORMATS)
SNIFFED_BYTES = 4096
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
        return fingerprint([asdict(self.source), asdict(self.target), said])


async def read_submission(request: Request, service: Service) -> Submission:
    """Read and check the body; files are on disk afterwards, nothing is decoded."""
    content_type = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if content_type == "multipart/form-data":
        limit = service.settings.max_body_bytes
        form = await read_multipart(request, service.blobs, limit)
        submission = await run_in_threadpool(_from_form, form, service.blobs)
    elif content_type == "application/json":
        submission = _from_json(await read_text(request), service.settings)
    else:
        raise UnsupportedContentTypeError(
            "Send multipart/form-data with the files source and target, or application/json with "
            "their URLs.",
            headers={"Accept-Post": "multipart/form-data, application/json"},
        )
    if submission.parameters.callback_url is not None:
        callback = str(submission.parameters.callback_url)
        check_address(callback, service.settings.webhook_hosts, "MPE_WEBHOOK_HOSTS")
    return submission


def _from_form(form: dict[str, Blob | str], blobs: BlobStore) -> Submission:
    clouds = {role: _uploaded(role, form.pop(role, None), blobs) for role in CLOUDS}
    fields: dict[str, Any] = {}
    for name, text in form.items():
        if isinstance(text, Blob):
            raise InvalidRequestError("There is a file beside source and target.")
        fields[name] = _parsed(name, text)
    try:
        parameters = RegistrationParameters.model_validate_json(json.dumps(fields))
    except ValidationError as error:
        raise invalid_request(error) from None
    return Submission(**clouds, parameters=parameters)


def _uploaded(role: str, field: Blob | str | None, blobs: BlobStore) -> CloudInput:
    if not isinstance(field, Blob):
        raise InvalidRequestError(f"{role}: expected a file; send it as -F {role}=@scan.ply.")
    if field.size == 0:
        raise InvalidRequestError(f"{role}: the file is empty.")
    with blobs.path(field.sha256).open("rb") as file:
        if sniff(file.read(SNIFFED_BYTES)) is None:
            raise UnknownFormatError(
                f"{role}: the file begins like none of the formats {_FORMATS}."
            )
    return CloudInput(sha256=field.sha256, size=field.size)


def _parsed(name: str, text: str) -> Any:
    if name == "callback_url":
        return text
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        where = name if name in RegistrationParameters.model_fields else "a field of the form"
        raise InvalidRequestError(f"{where}: expected JSON.") from None


def _from_json(body: bytes, settings: Settings) -> Submission:
    try:
        wanted = RegistrationRequest.model_validate_json(body)
    except ValidationError as error:
        if error.errors()[0]["type"] == "json_invalid":
            raise MalformedBodyError("The body is not JSON.") from None
        raise invalid_request(error) from None
    return Submission(
        source=_linked(wanted.source, settings),
        target=_linked(wanted.target, settings),
        parameters=wanted,
    )


def _linked(reference: UrlReference, settings: Settings) -> CloudInput:
    url = str(reference.url)
    check_address(url, settings.url_hosts, "MPE_URL_HOSTS")
    return CloudInput(url=url)
