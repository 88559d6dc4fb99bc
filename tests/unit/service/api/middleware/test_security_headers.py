"""Security headers: on every response, never against what the route has set itself."""

from __future__ import annotations

import asyncio

import pytest
from starlette.datastructures import Headers
from starlette.types import Message, Receive, Scope, Send

from service.api.middleware.security_headers import SECURITY_HEADERS, SecurityHeadersMiddleware


def headers_of(path: str, *, scheme: str = "http", own: dict[str, str] | None = None) -> Headers:
    sent: list[Message] = []
    raw = [(name.lower().encode(), value.encode()) for name, value in (own or {}).items()]

    async def app(scope: Scope, receive: Receive, send: Send) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": raw})

    async def send(message: Message) -> None:
        sent.append(message)

    async def receive() -> Message:
        raise AssertionError("nothing is read")

    scope = {"type": "http", "path": path, "scheme": scheme, "headers": []}
    asyncio.run(SecurityHeadersMiddleware(app)(scope, receive, send))
    return Headers(scope=sent[0])


@pytest.mark.parametrize("path", ["/", "/livez", "/v1/clouds"])
def test_every_response_has_them(path: str) -> None:
    headers = headers_of(path)
    assert {name: headers[name] for name in SECURITY_HEADERS} == SECURITY_HEADERS


def test_what_belongs_to_a_tenant_is_never_cached() -> None:
    own = {"Cache-Control": "max-age=9"}
    assert headers_of("/v1/clouds", own=own).getlist("cache-control") == ["no-store"]
    assert headers_of("/openapi.json", own=own).getlist("cache-control") == ["max-age=9"]


def test_hsts_over_https_only() -> None:
    assert "strict-transport-security" not in headers_of("/v1/clouds")
    assert headers_of("/v1/clouds", scheme="https")["strict-transport-security"] == (
        "max-age=31536000"
    )


def test_a_route_may_set_its_own() -> None:
    own = {"Referrer-Policy": "same-origin"}
    assert headers_of("/", own=own).getlist("referrer-policy") == ["same-origin"]
