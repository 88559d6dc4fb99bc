"""JSON bodies of bounded length, after the caller is known and outside of the event loop.

FastAPI would read a body of any length into memory, before it asks who sends it.
"""

from __future__ import annotations

from typing import TypeVar

from fastapi import Request
from pydantic import BaseModel, ValidationError
from starlette.concurrency import run_in_threadpool

from service.api.body import read_text
from service.api.error_handlers import invalid_request
from service.problems import MalformedBodyError, UnsupportedContentTypeError

JSON_TYPE = "application/json"
ModelT = TypeVar("ModelT", bound=BaseModel)


def content_type(request: Request) -> str:
    """Return the content type of the body, without parameters and in lower case."""
    return request.headers.get("content-type", "").partition(";")[0].strip().lower()


async def read_json(request: Request, model: type[ModelT]) -> ModelT:
    """Read the body as a document of this model.

    Raises
    ------
    UnsupportedContentTypeError
        The body is not JSON by its content type.
    BodyTooLargeError, MalformedBodyError, InvalidRequestError
        It is too long, no JSON, or not what the model allows.
    """
    if content_type(request) != JSON_TYPE:
        raise UnsupportedContentTypeError(f"Send {JSON_TYPE}.", headers={"Accept-Post": JSON_TYPE})
    return await run_in_threadpool(parse_json, await read_text(request), model)


def parse_json(body: bytes, model: type[ModelT]) -> ModelT:
    """Return the document that a body holds.

    Raises
    ------
    MalformedBodyError, InvalidRequestError
        It is no JSON, or not what the model allows.
    """
    try:
        return model.model_validate_json(body)
    except ValidationError as error:
        if error.errors()[0]["type"] == "json_invalid":
            raise MalformedBodyError("The body is not JSON.") from None
        raise invalid_request(error) from None
