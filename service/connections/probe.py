"""Probes (GET /livez) are answered where they are parsed, without a task."""

from __future__ import annotations

from http import HTTPStatus

import h11
from starlette.types import ASGIApp, Message, Scope

PROBE = b"GET /livez HTTP/1.1\r\n"
PLAIN_HEADERS = frozenset(
    {
        *(b"host", b"user-agent", b"accept", b"accept-encoding", b"connection"),
        *(b"if-none-match", b"x-request-id"),
    }
)
"""Headers of probes; with others, such as those of proxies and pages, a request is no probe."""


def is_probe(request: h11.Request) -> bool:
    """Return whether a request that begins with PROBE has neither a body nor unusual headers."""
    return all(name in PLAIN_HEADERS for name, _ in request.headers)


def answer_probe(
    app: ASGIApp, request: h11.Request, headers: list[tuple[bytes, bytes]]
) -> list[h11.Event]:
    """Return the response of an application that waits for nothing, with headers before its own.

    Raises
    ------
    RuntimeError
        The application waits.
    """
    scope: Scope = {
        "type": "http",
        "method": "GET",
        "scheme": "http",
        "path": request.target.decode("ascii"),
        "headers": list(request.headers),
    }
    events: list[h11.Event] = []

    async def send(message: Message) -> None:
        if message["type"] == "http.response.start":
            status, own = HTTPStatus(message["status"]), message["headers"]
            reason = status.phrase.encode()
            events.append(h11.Response(status_code=status, headers=headers + own, reason=reason))
        else:
            events.append(h11.Data(data=message["body"]))

    async def receive() -> Message:
        return {"type": "http.request", "body": b""}

    run = app(scope, receive, send)
    try:
        run.__await__().__next__()
    except StopIteration:
        return [*events, h11.EndOfMessage()]
    raise RuntimeError("the application that answers probes waits")
