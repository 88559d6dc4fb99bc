"""Errors over HTTP: problem documents with their headers, counted, and never the input."""

from __future__ import annotations

import asyncio
import errno
from pathlib import Path
from unittest import mock

import httpx
import pytest
from anyio import BrokenResourceError

from service.jobs.queries import JobQueries
from tests.factories.api import api_client


def answered(root: Path, method: str, path: str) -> httpx.Response:
    async def run() -> httpx.Response:
        async with api_client(root) as (client, _):
            return await client.request(method, path)

    return asyncio.run(run())


@pytest.mark.parametrize(
    ("method", "path", "status", "kind"),
    [
        ("GET", "/v1/nothing", 404, "not-found"),
        ("GET", "/v1/clouds/none", 404, "unknown-cloud"),
        ("PUT", "/v1/registrations", 405, "method-not-allowed"),
        ("GET", "/v1/registrations?limit=secret", 422, "invalid-request"),
        ("POST", "/v1/registrations", 415, "unsupported-content-type"),
    ],
)
def test_every_error_is_a_problem_document(
    tmp_path: Path, method: str, path: str, status: int, kind: str
) -> None:
    response = answered(tmp_path, method, path)
    assert response.status_code == response.json()["status"] == status
    assert response.headers["Content-Type"] == "application/problem+json"
    assert response.json()["type"] == f"urn:mpe:problem:{kind}"
    assert "secret" not in response.text


def test_all_methods_of_a_path_are_allowed(tmp_path: Path) -> None:
    """Also those of its other routes."""
    assert (
        answered(tmp_path, "PATCH", "/v1/clouds/door").headers["Allow"] == "DELETE, GET, HEAD, PUT"
    )


def test_an_unexpected_error_tells_nothing_and_is_counted(tmp_path: Path) -> None:
    async def run() -> None:
        async with api_client(tmp_path) as (client, _):
            with mock.patch.object(JobQueries, "get", side_effect=RuntimeError("secret")):
                response = await client.get("/v1/registrations/x")
            assert response.status_code == 500
            assert response.json()["type"] == "urn:mpe:problem:internal-error"
            assert response.headers["Cache-Control"] == "no-store"
            assert "secret" not in response.text

    asyncio.run(run())


@pytest.mark.parametrize(
    ("error", "status", "kind"),
    [
        (OSError(errno.ENOSPC, "secret"), 507, "disk-full"),
        (OSError(errno.EMFILE, "secret"), 503, "overloaded"),
        (OSError(errno.EIO, "secret"), 500, "internal-error"),
    ],
)
def test_a_full_disk_is_told_as_such(
    tmp_path: Path, error: OSError, status: int, kind: str
) -> None:
    async def run() -> None:
        async with api_client(tmp_path) as (client, _):
            with mock.patch.object(JobQueries, "get", side_effect=error):
                response = await client.get("/v1/registrations/x")
            assert response.status_code == status
            assert response.json()["type"] == f"urn:mpe:problem:{kind}"
            assert "secret" not in response.text

    asyncio.run(run())


@pytest.mark.parametrize(
    ("errors", "is_logged"),
    [
        ([BrokenResourceError()], False),
        ([BrokenResourceError(), RuntimeError("odd")], True),
    ],
)
def test_a_caller_who_leaves_a_stream_is_no_error(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, errors: list[Exception], is_logged: bool
) -> None:
    async def run() -> None:
        async with api_client(tmp_path) as (client, _):
            group = ExceptionGroup("in a task group", errors)
            with mock.patch.object(JobQueries, "get", side_effect=group):
                await client.get("/v1/registrations/x")

    asyncio.run(run())
    assert ("unexpected error" in caplog.text) == is_logged
