"""Redirects, each checked like the URL that it came from."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from urllib.parse import urljoin

from service.outbound.client import OutboundClient, OutboundResponse
from service.outbound.deadline import TransferDeadline
from service.outbound.errors import AddressRefusedError, FetchError
from service.outbound.urls import Url, parse_url

MAX_REDIRECTS = 5
STATUSES = (301, 302, 303, 307, 308)


@contextmanager
def follow(
    door: OutboundClient,
    url: Url,
    watch: TransferDeadline,
    headers_for: Callable[[Url], dict[str, str]],
) -> Iterator[OutboundResponse]:
    """GET the URL, or where it leads; each step is sent only the headers that are meant for it."""
    for _ in range(MAX_REDIRECTS + 1):
        with door.call("GET", url, watch, headers=headers_for(url)) as answer:
            location = answer.headers.get("location")
            if answer.status not in STATUSES or location is None:
                yield answer
                return
        url = _next(url, location)
    raise FetchError(f"The URL leads to more than {MAX_REDIRECTS} redirects.")


def _next(url: Url, location: str) -> Url:
    try:
        found = parse_url(urljoin(str(url), location))
    except ValueError:
        raise AddressRefusedError("The redirect of the URL cannot be read.") from None
    if url.scheme == "https" and found.scheme == "http":
        raise AddressRefusedError("The URL is redirected from https to http.")
    return found
