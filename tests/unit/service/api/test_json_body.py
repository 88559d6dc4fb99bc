"""JSON bodies: bounded, and read only from those who may call."""

from __future__ import annotations

import asyncio
from pathlib import Path

import httpx
import pytest
from fastapi.routing import APIRoute, iter_route_contexts
from pydantic import BaseModel

from service.api.body import MAX_TEXT_BYTES
from service.api.json_body import read_json
from service.app import create_app
from service.problems import (
    BodyTooLargeError,
    InvalidRequestError,
    MalformedBodyError,
    UnsupportedContentTypeError,
)
from service.runtime import Runtime
from service.settings import Settings
from tests.factories.api import on_api, request_of

JSON_TYPE = {"Content-Type": "application/json; charset=utf-8"}
PRESIGN = "/v1/clouds/presign"


class Number(BaseModel):
    value: int


def read(body: bytes, headers: dict[str, str] = JSON_TYPE) -> Number:
    return asyncio.run(read_json(request_of([body], headers), Number))


def test_a_document_is_read() -> None:
    assert read(b'{"value": 3}') == Number(value=3)


@pytest.mark.parametrize("body", [b"", b"{", b"\xff{}", b'{"value": "\\ud800"}', b"[" * 9000])
def test_what_is_no_json_is_malformed(body: bytes) -> None:
    with pytest.raises(MalformedBodyError):
        read(body)


def test_another_document_is_refused() -> None:
    with pytest.raises(InvalidRequestError, match="/value"):
        read(b'{"value": "three"}')


def test_another_content_type_is_refused() -> None:
    with pytest.raises(UnsupportedContentTypeError):
        read(b'{"value": 3}', {"Content-Type": "text/plain"})


def test_a_long_body_is_refused() -> None:
    with pytest.raises(BodyTooLargeError):
        read(b" " * (MAX_TEXT_BYTES + 1))


def test_no_route_lets_the_framework_read_the_body(tmp_path: Path) -> None:
    """It reads one of any length into memory, before it looks who sends it."""
    app = create_app(Settings(data_dir=tmp_path))
    routes = [found.original_route for found in iter_route_contexts(app.routes)]
    api = [route for route in routes if isinstance(route, APIRoute)]
    assert PRESIGN in {route.path for route in api}
    assert not [route.path for route in api if route.body_field is not None]


def test_who_has_no_key_is_not_read(tmp_path: Path) -> None:
    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        answer = await client.post(PRESIGN, content=b"[" * 1000, headers=JSON_TYPE)
        assert answer.status_code == 401

    on_api(tmp_path, use, require_keys=True)
