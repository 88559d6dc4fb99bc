"""Whatever is sent, no step of the event loop takes long: other requests are answered between."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from service.runtime import Runtime
from service.schemas.inlier_file import INLIER_DTYPE
from tests.factories.api import FORM_TYPE, XYZ, form, on_api, part
from tests.factories.finished import add_finished
from tests.factories.hostile_files import HUGE
from tests.factories.jobs import new_job

MAX_STEP_S = 0.05
"""Processor time of one step; the longest of these takes 13 ms."""
JSON_TYPE = {"Content-Type": "application/json"}
JOBS = "/v1/registrations"
DIGITS = b"1\n1\n" + b"11111111 11111111 11111111\n" * 4 + b"x" * 40
FILES = {"digits": DIGITS, "one line": b"1" * 1_000_000, "braces": b"{" * 100_000, **HUGE}


def _job(**fields: str) -> dict[str, Any]:
    parts = [part(name, value.encode()) for name, value in fields.items()]
    clouds = [part(name, XYZ, filename="a") for name in ("source", "target")]
    return {"method": "POST", "url": JOBS, "content": form(*clouds, *parts), "headers": FORM_TYPE}


def _json(url: str, text: str) -> dict[str, Any]:
    return {"method": "POST", "url": url, "content": text.encode(), "headers": JSON_TYPE}


REQUESTS: dict[str, dict[str, Any]] = {
    **{
        f"cloud: {name}": {"method": "PUT", "url": "/v1/clouds/a", "content": content}
        for name, content in FILES.items()
    },
    "near boundaries": {
        "method": "POST",
        "url": JOBS,
        "content": form(part("source", b"\r\n--b0unX" * 500_000, filename="a")),
        "headers": FORM_TYPE,
    },
    "many parts": {
        "method": "POST",
        "url": JOBS,
        "content": form(*[part("x", b"")] * 50_000),
        "headers": FORM_TYPE,
    },
    "long labels": _job(labels=json.dumps({"x" * 60: "y" * 60_000})),
    "many labels": _job(labels=json.dumps({f"x{i}": "y" for i in range(50_000)})),
    "deep options": _job(options='{"a":' * 20_000),
    "long number": _job(options='{"seed": ' + "9" * 200_000 + "}"),
    "long JSON": _json(JOBS, json.dumps({"source": ["a"] * 2_000_000})),
    "deep JSON": _json(JOBS, "[" * 2_000_000),
    "wide JSON": _json(JOBS, json.dumps({f"f{i}": i for i in range(300_000)})),
    "long announcement": _json("/v1/clouds/presign", json.dumps({"size": ["a"] * 4_000_000})),
    "long query": {"method": "GET", "url": JOBS + "?label=" + "a:b&label=" * 5000 + "a:b"},
}


@contextmanager
def measured_steps() -> Iterator[list[float]]:
    """Processor seconds of each step of the loop; what is measured runs as a task of its own."""
    steps: list[float] = []
    run = asyncio.events.Handle._run  # type: ignore[attr-defined]

    def timed(handle: object) -> object:
        started = time.thread_time()
        try:
            return run(handle)
        finally:
            steps.append(time.thread_time() - started)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(asyncio.events.Handle, "_run", timed)
        yield steps


def test_no_request_holds_the_loop(tmp_path: Path) -> None:
    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        await client.get("/livez")  # what is built once
        for name, request in REQUESTS.items():
            content = request.get("content", b"")
            sent = {**request, "content": _in_pieces(content)}
            with measured_steps() as steps:
                answer = await asyncio.create_task(client.request(**sent))
            assert answer.status_code < 500, (name, answer.text)
            assert max(steps) < MAX_STEP_S, (name, answer.status_code)

    on_api(tmp_path, use)


async def _in_pieces(content: bytes) -> Any:
    """As a connection delivers them."""
    for start in range(0, len(content), 65536):
        yield content[start : start + 65536]


LONGEST = {
    "labels": {f"{i:064}": "\u00e9" * 256 for i in range(16)},
    "callback_url": "http://there/" + "x" * 8000,
    "warnings": ["y" * 400] * 16,
}
"""Texts of a registration, as long as they may be."""


def test_no_long_answer_holds_the_loop(tmp_path: Path) -> None:
    async def use(client: httpx.AsyncClient, runtime: Runtime) -> None:
        pairs = np.zeros(200_000, INLIER_DTYPE)
        job = f"{JOBS}/{add_finished(runtime, inliers=pairs)}"
        for _ in range(200):
            runtime.submit(new_job(tenant="default", **LONGEST))
        for path in (f"{JOBS}?limit=200", job, f"{job}/inliers", "/openapi.json", "/metrics"):
            await client.get("/livez")
            with measured_steps() as steps:
                answer = await asyncio.create_task(client.get(path))
            assert answer.status_code == 200, path
            assert max(steps) < MAX_STEP_S, (path, max(steps), len(answer.content))

    on_api(tmp_path, use)
