"""Raw odd requests to the whole application: each is answered below 500, or closed."""

from __future__ import annotations

import asyncio
import json
import re
from pathlib import Path

from fastapi.routing import iter_route_contexts
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from service.app import create_app
from service.settings import Settings
from tests.factories.api import idle_runtime
from tests.factories.connections import exchange, listening
from tests.factories.finished import FakeExporter, add_finished

METHODS = ["GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", "TRACE", "BREW", "get"]
APP_PATHS = sorted(
    {
        route.path
        for route in iter_route_contexts(create_app(Settings(data_dir=Path("/none"))).routes)
    }
)
FINISHED = "FINISHED"
"""Stands for the id of a registration that has succeeded."""
IDS = (FINISHED, "x", "%00", "%ff%fe", "..%2F..", "a" * 300, "a" * 300 + ".js")
PATHS = [re.sub(r"\{[\w:]+\}", name, path) for path in APP_PATHS for name in IDS]
PATHS += ["//", "*", "http://localhost/livez", "/v1/../livez", "/assets/..%2findex.html"]
QUERIES = [
    "",
    "?limit=99999999999999999999",
    "?limit=-1",
    "?cursor=%00",
    "?label=a:%00%ff",
    "?created_after=0001-01-01T00:00:00%2B23:59",
    "?created_before=9999-12-31T23:59:59-23:59",
    "?search=%00",
    "?search=%25%5C_%ff%20a%20b%20c%20d%20e%20f%20g%20h%20i%20j",
    "?status=%F0%9F%92%A9",
    "?format=npy&format=&merged=maybe",
    "?role=source&max_points=1",
    "?role=target&max_points=0",
    "?tolerance=1e999&tolerance=-1&tolerance=nan&max_distance=inf",
    "?tolerance=0.5&unit=%00&unit=mm",
    "?format=stl&distances=true&merged=true",
    "?" + "a=" * 500,
]
HEADERS = [
    "Prefer: wait=999999",
    "Prefer: wait=0",
    "Accept: ;;q=,*/*;q=0",
    "Range: bytes=9-1",
    "If-None-Match: *",
    "If-Range: W/",
    "Range: bytes=0-0,2-1,999999-",
    "Content-Type: multipart/form-data; boundary=",
    "Content-Type: multipart/form-data; boundary=x",
    "Content-Type: application/json; charset=utf-7",
    "Content-Type: \xff",
    "Content-Type: application/offset+octet-stream",
    "Idempotency-Key: \xe9",
    "Authorization: Bearer \xff",
    "Tus-Resumable: 1.0.0",
    "Upload-Length: 99999999999999999999999",
    "Upload-Offset: -0",
    "Last-Event-ID: 1e3",
    "X-Request-ID: a b",
    "Expect: 100-continue",
    "Upgrade: websocket",
    "Transfer-Encoding: chunked",
    "Content-Length: 3",
    "Content-Length: 003",
    "Content-Length: 99999999999999999999",
    "Connection: keep-alive, close",
]
BODIES = [
    b"",
    b"{}",
    b"[1",
    b'{"a":' * 2000,
    b'{"source":{"url":"http://\\u0000"},"target":{"cloud":"\\ud800"}}',
    b'{"source":{"cloud":"a"},"target":{"cloud":"b"},"labels":{"a":"\\u0000"},"priority":1e400}',
    b"3\r\nabc\r\n0\r\n\r\n",
    b"FFFFFFFFFFFFFFFFFFFF\r\n",
    b"--x\r\nContent-Disposition: form-data; name=source; filename=a\r\n\r\n0 0 0\r\n--x--\r\n",
    b"--x\r\nContent-Disposition: form-data; name=\xff\r\n\r\n\xff\r\n--x--",
    b"\0" * 100,
]
requests = st.builds(
    lambda method, path, query, headers, body: (
        (
            f"{method} {path}{query} HTTP/1.1\r\nHost: localhost\r\n"
            + "".join(f"{header}\r\n" for header in headers)
            + "Connection: close\r\n\r\n"
        ).encode("latin-1")
        + body
    ),
    st.sampled_from(METHODS),
    st.sampled_from(PATHS),
    st.sampled_from(QUERIES),
    st.lists(st.sampled_from(HEADERS), max_size=5),
    st.sampled_from(BODIES),
)
noise = st.binary(min_size=1, max_size=200)


def check(response: bytes) -> None:
    """An answer is none, or whole, and no error of the service."""
    if not response:
        return
    head, _, body = response.partition(b"\r\n\r\n")
    status = int(head.split()[1])
    assert status < 500 or status in (501, 503), response[:500]
    assert b"text/plain" not in head or status < 400, head
    if status >= 400 and body and b"application/problem+json" in head.lower():
        assert json.loads(body)["status"] == status


def test_odd_requests_are_never_errors_of_the_service(tmp_path: Path) -> None:
    @settings(
        max_examples=30,
        deadline=None,
        database=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(st.lists(st.one_of(requests, requests, requests, noise), min_size=8, max_size=8))
    def ask_all(batch: list[bytes]) -> None:
        loop.run_until_complete(ask(batch))

    async def ask(batch: list[bytes]) -> None:
        found = [sent.replace(FINISHED.encode(), job) for sent in batch]
        for response in await asyncio.gather(*(exchange(port, sent, 20) for sent in found)):
            check(response)

    options = {"max_wait_s": 0.1, "min_free_disk_bytes": 0, "min_free_memory_bytes": 0}
    app = create_app(Settings(data_dir=tmp_path, **options))
    loop = asyncio.new_event_loop()

    async def start() -> tuple[int, bytes]:
        app.state.runtime = opened = runtime.__enter__()
        opened.exporter.export = FakeExporter(tmp_path).export  # type: ignore[method-assign]
        return await server.__aenter__(), add_finished(opened).encode()

    runtime = idle_runtime(tmp_path, **options)
    server = listening(app, head_s=0.2, stall_s=0.4, idle_s=1)
    port, job = loop.run_until_complete(start())
    try:
        ask_all()
    finally:
        loop.run_until_complete(server.__aexit__(None, None, None))
        runtime.__exit__(None, None, None)
        loop.close()
