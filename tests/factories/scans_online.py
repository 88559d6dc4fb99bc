"""A web server that gives a scan in good and in bad ways, and registrations of what it gives."""

from __future__ import annotations

import ssl
from collections.abc import Iterator
from contextlib import contextmanager

import httpx

from tests.factories.scans import arms, as_npy
from tests.factories.server import Server
from tests.factories.web import Handler, Web, serving

CLOUD = as_npy(arms(1))


def give_if_changed(handler: Handler) -> None:
    if handler.headers.get("If-None-Match") == '"1"':
        handler.head(304, ETag='"1"')
    else:
        handler.give(CLOUD, ETag='"1"')


def cut(handler: Handler) -> None:
    """The first half, then the rest."""
    half, said = len(CLOUD) // 2, {"ETag": '"1"', "Content-Length": str(len(CLOUD))}
    if "Range" not in handler.headers:
        handler.head(**said)
        handler.wfile.write(CLOUD[:half])
        handler.close_connection = True
        return
    said["Content-Range"] = f"bytes {half}-{len(CLOUD) - 1}/{len(CLOUD)}"
    handler.head(206, **said | {"Content-Length": str(len(CLOUD) - half)})
    handler.wfile.write(CLOUD[half:])


def drip(handler: Handler) -> None:
    handler.head(Content_Length=str(len(CLOUD)))
    handler.drip(every_s=0.1)


BEHAVIOURS = {
    "/cloud.npy": lambda handler: handler.give(CLOUD),
    "/moved": lambda handler: handler.give(b"", 302, Location="/cloud.npy"),
    "/to-metadata": lambda handler: handler.give(
        b"", 302, Location="http://169.254.169.254/latest/"
    ),
    "/round": lambda handler: handler.give(b"", 302, Location="/round"),
    "/large": lambda handler: handler.head(Content_Length=str(10**9)),
    "/known": give_if_changed,
    "/cut": cut,
    "/drip": drip,
}


@contextmanager
def scans_online(tls: ssl.SSLContext | None = None) -> Iterator[Web]:
    """The server, which behaves by path as BEHAVIOURS says."""
    with serving(tls=tls) as running:
        running.behaviours |= BEHAVIOURS
        yield running


def post(server: Server, source: str, target: str | None = None) -> httpx.Response:
    return server.client.post(
        "/v1/registrations",
        json={
            "source": {"url": source},
            "target": {"url": target or source},
            "options": {"seed": 3},
        },
        headers={"Prefer": "wait=60"},
    )
