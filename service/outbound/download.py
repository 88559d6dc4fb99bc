"""Download of one file.

A cached file is asked for only if it has changed (RFC 9110, section 13). A transfer that was cut
is continued where it stopped, if the server promises that the rest belongs to the same file
(RFC 9110, section 14).
"""

from __future__ import annotations

import re
import time
from dataclasses import dataclass, field
from enum import Enum, auto
from pathlib import Path
from typing import BinaryIO

from service.outbound.client import OutboundClient, OutboundResponse
from service.outbound.deadline import TransferDeadline, TransferLimits
from service.outbound.errors import (
    FetchCutError,
    FetchError,
    FetchStatusError,
    FetchTooLargeError,
    FetchUnreachableError,
)
from service.outbound.http_cache import CachedFile, HttpCache, Validators, hash_key
from service.outbound.urls import Url

RETRY_PAUSES_S = (0.2, 0.5, 1.0, 2.0)
"""Seconds before each further attempt after a cut."""
OK, PARTIAL_CONTENT, NOT_MODIFIED, RANGE_NOT_SATISFIABLE = 200, 206, 304, 416
ACCEPTED_ENCODINGS = ("", "identity", "gzip")
"""Encodings whose bytes are stored as they come; the format readers expand gzip within bounds."""
_CONTENT_RANGE = re.compile(r"bytes ([0-9]{1,18})-[0-9]{1,18}/(?:([0-9]{1,18})|\*)")
_LENGTH = re.compile(r"[0-9]{1,18}")


@dataclass(frozen=True, slots=True)
class PartialFile:
    """The bytes of a file that arrived before its transfer was cut."""

    url: Url
    validator: str | None
    """Strong validator of the file; None: nothing promises that the rest belongs to it."""
    size: int


class Action(Enum):
    """What to do with the body of a response."""

    RESTART = auto()
    """Store it as the whole file."""
    RESUME = auto()
    """Append it to the partial file."""
    DISCARD = auto()
    """Drop it: it fits neither; ask for the whole file again."""


def choose_action(partial: PartialFile | None, response: OutboundResponse) -> Action:
    """Decide what to do with a response, given what has arrived before.

    Raises
    ------
    FetchStatusError
        The response holds no file.
    FetchError
        The body is encoded, or a part of a file, without having been asked for so.
    """
    if response.status == RANGE_NOT_SATISFIABLE and partial is not None:
        return Action.DISCARD
    if response.status not in (OK, PARTIAL_CONTENT):
        raise FetchStatusError(f"The URL answered {response.status} instead of 200.")
    encoding = response.headers.get("content-encoding", "").strip().lower()
    if encoding not in ACCEPTED_ENCODINGS:
        raise FetchError("The URL's file is compressed in a way that was not asked for.")
    content_range = response.headers.get("content-range")
    if response.status == OK and content_range is None:
        return Action.RESTART
    match = _CONTENT_RANGE.fullmatch(content_range or "")
    if partial is None or match is None:
        raise FetchError("The URL sent a part of a file that was not asked for.")
    # some servers heed Range, but not If-Range
    rest = PartialFile(response.url, Validators.of(response.headers).strong, int(match[1]))
    is_rest = partial.validator is not None and rest == partial
    return Action.RESUME if is_rest else Action.DISCARD


def announced_size(response: OutboundResponse) -> int:
    """Return the size of the whole file in bytes as far as the headers tell, else 0."""
    if match := _CONTENT_RANGE.fullmatch(response.headers.get("content-range", "")):
        return int(match[2] or 0)
    match = _LENGTH.fullmatch(response.headers.get("content-length", ""))
    return int(match[0]) if match else 0


@dataclass(frozen=True, slots=True)
class Download:
    """How a download ended."""

    key: str
    """Key in the cache of the URL that the file came from, see `hash_key`."""
    validators: Validators
    is_cached: bool
    """Whether the cached file is still current, so that nothing was written."""


@dataclass(slots=True)
class PartFile:
    """A file that is being written, and begun again if need be."""

    file: BinaryIO
    size: int = 0
    """Number of bytes written so far."""

    def write(self, chunk: bytes) -> None:
        """Append a chunk."""
        self.file.write(chunk)
        self.size += len(chunk)

    def restart(self) -> None:
        """Drop what was written so far and begin again."""
        self.file.seek(0)
        self.file.truncate()
        self.size = 0


@dataclass(slots=True)
class Transfer:
    """State of one download, kept across its attempts."""

    url: Url
    cache_key: str
    cache: HttpCache
    writer: PartFile
    max_bytes: int
    partial: PartialFile | None = None
    revalidated: dict[Url, CachedFile] = field(default_factory=dict)
    """Cached files that were asked for only if they had changed."""

    def key_of(self, url: Url) -> str:
        """Return the key that the file at this URL, the first or a redirect, is cached under."""
        return hash_key(self.cache_key if url == self.url else str(url))

    def headers_for(self, url: Url) -> dict[str, str]:
        """Return the request headers: the rest of a partial file, or a changed file only."""
        headers = {"Accept-Encoding": "identity"}
        if self.partial is not None:
            has_rest = self.partial.url == url and self.partial.size > 0
            if not has_rest or self.partial.validator is None:
                return headers
            range_ = f"bytes={self.partial.size}-"
            return headers | {"Range": range_, "If-Range": self.partial.validator}
        cached = self.cache.find(self.key_of(url))
        if cached is None:
            return headers
        self.revalidated[url] = cached
        return headers | cached.validators.conditions

    def receive(self, response: OutboundResponse) -> None:
        """Write the body; `partial` says what has arrived if an exception ends it.

        Raises
        ------
        FetchError
            The response is not the file, or not the rest of it, or too large.
        """
        action = choose_action(self.partial, response)
        if action is Action.DISCARD:
            self.partial = PartialFile(response.url, None, self.writer.size)
            raise FetchCutError("The rest of the URL's file does not fit what came before.")
        self._check_size(announced_size(response))
        if action is Action.RESTART:
            self.writer.restart()
        validator = Validators.of(response.headers).strong
        try:
            for chunk in response.chunks:
                self.writer.write(chunk)
                self._check_size(self.writer.size)
        finally:
            self.partial = PartialFile(response.url, validator, self.writer.size)

    def _check_size(self, size: int) -> None:
        if size > self.max_bytes:
            raise FetchTooLargeError(f"The URL gives more than the allowed {self.max_bytes} bytes.")


def download(
    client: OutboundClient,
    url: Url,
    output: Path,
    cache: HttpCache,
    *,
    limits: TransferLimits,
    max_bytes: int,
    cache_key: str | None = None,
) -> Download:
    """Write the file at a URL to `output`, unless the cached one is still current.

    Parameters
    ----------
    client : OutboundClient
        Client that sends the requests.
    url : Url
        Where the file is.
    output : Path
        Where it is written.
    cache : HttpCache
        Files that were downloaded before.
    limits : TransferLimits
        Bounds on the time of all attempts together.
    max_bytes : int
        Maximum size of the file.
    cache_key : str, optional
        Key in the cache for a URL that is never the same twice; default: the URL.

    Raises
    ------
    AddressRefusedError
        The policy does not allow the URL or a redirect of it.
    FetchError
        The file could not be downloaded; the subclass tells why.
    """
    deadline = TransferDeadline(limits)
    with output.open("wb") as file:
        transfer = Transfer(url, cache_key or str(url), cache, PartFile(file), max_bytes)
        for pause_s in RETRY_PAUSES_S:
            try:
                return _attempt(client, transfer, deadline)
            except (FetchCutError, FetchUnreachableError):
                if transfer.partial is None:
                    raise
            time.sleep(min(pause_s, deadline.remaining()))
        return _attempt(client, transfer, deadline)


def _attempt(client: OutboundClient, transfer: Transfer, deadline: TransferDeadline) -> Download:
    with client.get(transfer.url, deadline, transfer.headers_for) as response:
        cached = transfer.revalidated.get(response.url)
        if response.status == NOT_MODIFIED and cached is not None:
            return Download(transfer.key_of(response.url), cached.validators, is_cached=True)
        transfer.receive(response)
    validators = Validators.of(response.headers)
    return Download(transfer.key_of(response.url), validators, is_cached=False)
