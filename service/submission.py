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
from service.sources import FetchRules, check_url
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
        said = self.parameters.model_dump(include=set(RegistrationParameters.model_fields))
        return fingerprint([asdict(self.source), asdict(self.target), said])


async def read_submission(request: Request, service: Service) -> Submission:
    """Read and check the body; files are on disk afterwards, nothing is decoded."""
    content_type = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if content_type == "multipart/form-data":
        limit = service.settings.max_body_bytes
        form = await read_multipart(request, service.blobs, limit)
        return await run_in_threadpool(_from_form, form, service.blobs)
    if content_type == "application/json":
        return _from_json(await read_text(request), FetchRules.of(service.settings))
    raise UnsupportedContentTypeError(
        "Send multipart/form-data with the files source and target, or application/json with "
        "their URLs.",
        headers={"Accept-Post": "multipart/form-data, application/json"},
    )


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
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        where = name if name in RegistrationParameters.model_fields else "a field of the form"
        raise InvalidRequestError(f"{where}: expected JSON.") from None


def _from_json(body: bytes, rules: FetchRules) -> Submission:
    try:
        wanted = RegistrationRequest.model_validate_json(body)
    except ValidationError as error:
        if error.errors()[0]["type"] == "json_invalid":
            raise MalformedBodyError("The body is not JSON.") from None
        raise invalid_request(error) from None
    return Submission(
        source=_linked(wanted.source, rules),
        target=_linked(wanted.target, rules),
        parameters=wanted,
    )


def _linked(reference: UrlReference, rules: FetchRules) -> CloudInput:
    url = str(reference.url)
    check_url(url, rules)
    return CloudInput(url=url)
