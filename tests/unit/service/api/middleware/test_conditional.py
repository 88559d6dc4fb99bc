"""What the caller has already is not sent again."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

import httpx
import pytest
from fastapi import FastAPI, Request
from starlette.responses import JSONResponse, Response, StreamingResponse

from service.api.middleware.conditional import ConditionalMiddleware, is_known
from service.api.middleware.head import HeadMiddleware


async def plain(request: Request) -> Response:
    return JSONResponse({"count": request.query_params.get("count", "1")})


async def tagged(request: Request) -> Response:
    return Response(b"1234", media_type="text/plain", headers={"ETag": 'W/"mine"'})


async def streamed(request: Request) -> Response:
    async def pieces() -> AsyncIterator[bytes]:
        yield b"1"
        yield b"2"

    return StreamingResponse(pieces())


async def missing(request: Request) -> Response:
    return JSONResponse({"detail": "no"}, status_code=404)


def ask(path: str, *, method: str = "GET", known: str | None = None) -> httpx.Response:
    app = FastAPI()
    for call in (plain, tagged, streamed, missing):
        app.add_api_route(f"/{call.__name__}", call, methods=["GET", "POST"], response_model=None)
    app.add_middleware(ConditionalMiddleware)
    app.add_middleware(HeadMiddleware)

    async def run() -> httpx.Response:
        transport = httpx.ASGITransport(app)
        async with httpx.AsyncClient(transport=transport, base_url="http://test") as client:
            headers = {} if known is None else {"If-None-Match": known}
            return await client.request(method, path, headers=headers)

    return asyncio.run(run())


def test_a_known_body_is_not_sent_again() -> None:
    first = ask("/plain")
    again = ask("/plain", known=first.headers["ETag"])
    assert (again.status_code, again.content) == (304, b"")
    assert again.headers["ETag"] == first.headers["ETag"]
    assert "content-length" not in again.headers
    changed = ask("/plain?count=2", known=first.headers["ETag"])
    assert (changed.status_code, changed.json()) == (200, {"count": "2"})


def test_the_tag_of_a_route_is_kept() -> None:
    assert ask("/tagged").headers["ETag"] == 'W/"mine"'
    assert ask("/tagged", known='"other", "mine"').status_code == 304


def test_head_has_the_tag_of_get() -> None:
    assert ask("/plain", method="HEAD").headers["ETag"] == ask("/plain").headers["ETag"]
    assert ask("/plain", method="HEAD", known="*").status_code == 304


@pytest.mark.parametrize(("path", "method"), [("/streamed", "GET"), ("/plain", "POST")])
def test_streams_and_other_methods_are_passed_on(path: str, method: str) -> None:
    response = ask(path, method=method, known="*")
    assert response.status_code == 200
    assert "ETag" not in response.headers
    assert response.content


def test_problems_are_passed_on() -> None:
    assert ask("/missing", known="*").status_code == 404


@pytest.mark.parametrize(
    ("tag", "known", "expected"),
    [
        ('"a"', '"a"', True),
        ('"a"', 'W/"a"', True),
        ('W/"a"', '"b" , "a"', True),
        ('"a"', "*", True),
        ('"a"', "a", False),
        ('"a"', "", False),
        ('"a"', ',,"', False),
    ],
)
def test_weak_comparison(tag: str, known: str, expected: bool) -> None:
    assert is_known(tag, known) == expected
