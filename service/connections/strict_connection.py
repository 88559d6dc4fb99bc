"""Heads of requests that two programs could read differently are refused, or made plain."""

from __future__ import annotations

import re
from typing import Any

import h11

MAX_HEAD_BYTES = 16 * 1024
"""Longest request line and headers, in bytes."""
METHODS = frozenset(b"GET HEAD POST PUT PATCH DELETE OPTIONS TRACE CONNECT QUERY".split())
"""Methods that the application sees: RFC 9110, 9.3, PATCH (RFC 5789), and QUERY."""
_FOLD = re.compile(rb"\n[ \t]")
_ABSOLUTE = re.compile(rb"https?://([^/?#]*)(.*)", re.IGNORECASE | re.DOTALL)


class StrictConnection(h11.Connection):
    """An h11 connection that refuses requests whose length two programs could read differently."""

    def __init__(self) -> None:
        super().__init__(h11.SERVER, MAX_HEAD_BYTES)
        self.refused_status = 400
        self._peeked: Any = None

    def is_before(self, start: bytes) -> bool:
        """Return whether no request is under way and the bytes of the next one begin with these."""
        states = self.our_state, self.their_state
        return states == (h11.IDLE, h11.IDLE) and self.trailing_data[0].startswith(start)

    def peek(self) -> Any:
        """Parse the next event, which `next_event` returns again."""
        self._peeked = self.next_event()
        return self._peeked

    def next_event(self) -> Any:
        """Parse the next event.

        Raises
        ------
        h11.RemoteProtocolError
            The bytes are not HTTP/1.1, Content-Length comes beside Transfer-Encoding (RFC 9112,
            6.1), a header goes on in the next line (5.2), or nobody knows the method.
        """
        if self._peeked is not None:
            event, self._peeked = self._peeked, None
            return event
        before = self.trailing_data[0] if self.their_state is h11.IDLE else b""
        try:
            event = super().next_event()
        except h11.RemoteProtocolError as error:
            self.refused_status = error.error_status_hint
            raise
        if not isinstance(event, h11.Request):
            return event
        if event.method not in METHODS:
            self.refused_status = 501
            raise h11.RemoteProtocolError("unknown method")
        head = before[: len(before) - len(self.trailing_data[0])]
        _check_head(event, head)
        return _in_origin_form(event)


def _check_head(request: h11.Request, head: bytes) -> None:
    names = {name for name, _ in request.headers}
    if {b"content-length", b"transfer-encoding"} <= names:
        raise h11.RemoteProtocolError("Content-Length beside Transfer-Encoding")
    if _FOLD.search(head):
        raise h11.RemoteProtocolError("a header goes on in the next line")


def _in_origin_form(request: h11.Request) -> h11.Request:
    """Return the request with a target that is a path; a URL names the host, too (3.2.2)."""
    url = _ABSOLUTE.fullmatch(request.target)
    if url is None:
        return request
    host, rest = url.groups()
    others = [(name, value) for name, value in request.headers if name != b"host"]
    return h11.Request(
        method=request.method,
        target=rest if rest.startswith(b"/") else b"/" + rest,
        headers=[(b"host", host), *others],
        http_version=request.http_version,
    )
