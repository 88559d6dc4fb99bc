"""Answers of a service that is none: a handler for httpx, and clients of both kinds on it."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import httpx
import yaml

from mpe_client.core import Core
from mpe_client.retry import Patience
from mpe_client.session import Session
from mpe_client.transport import AsyncTransport, BlockingTransport
from tests.factories.server import PROJECT

DESCRIPTION: dict[str, Any] = yaml.safe_load((PROJECT / "openapi.yaml").read_text())
SCHEMAS: dict[str, Any] = DESCRIPTION["components"]["schemas"]
SHORT = Patience(max_s=5.0, first_s=0.001, most_s=0.01)
"""Enough for many tries, without a test that waits."""
Handler = Callable[[httpx.Request], httpx.Response]


def job(status: str = "succeeded", **members: Any) -> dict[str, Any]:
    """A job as the service renders it."""
    fields: dict[str, Any] = dict.fromkeys(SCHEMAS["Job"]["required"])
    cloud = {"sha256": None, "size": None, "url": None, "cloud": None, "reading": {}}
    fields |= {
        "id": "j1", "status": status, "created_at": "2026-01-05T09:30:00Z", "attempt": 1,
        "progress": {"stage": status, "fraction": 1.0}, "source": cloud, "target": cloud,
        "options": {}, "labels": {}, "priority": 0, "cached": False, "timing": {}, "warnings": [],
    }  # fmt: skip
    return fields | members


def problem(status: int, name: str = "invalid-request", **headers: str) -> httpx.Response:
    """A problem document."""
    document = {
        "type": f"urn:mpe:problem:{name}",
        "title": "Title",
        "status": status,
        "detail": "Do this.",
    }
    kind = {"Content-Type": "application/problem+json"}
    return httpx.Response(status, content=json.dumps(document), headers=kind | headers)


def blocking_core(handler: Handler, patience: Patience = SHORT, **kwargs: Any) -> Core:
    client = httpx.Client(transport=httpx.MockTransport(handler), base_url="http://service")
    return Core(Session(BlockingTransport(client), patience), **kwargs)


def async_core(handler: Handler, patience: Patience = SHORT, **kwargs: Any) -> Core:
    client = httpx.AsyncClient(transport=httpx.MockTransport(handler), base_url="http://service")
    return Core(Session(AsyncTransport(client), patience), **kwargs)
