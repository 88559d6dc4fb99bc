"""One file on its way to the store: asked for if changed, taken up again where it was cut."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from dataclasses import dataclass

from service.outbound.client import OutboundClient, OutboundResponse
from service.outbound.deadline import TransferDeadline, TransferLimits
from service.outbound.errors import (
    FetchCutError,
    FetchError,
    FetchStatusError,
    FetchTooLargeError,
    FetchUnreachableError,
)
from service.outbound.http_cache import CachedFile, HttpCache
from service.outbound.redirects import follow
from service.outbound.urls import Url
from service.outbound.validators import Validators
from service.storage.blobs import Blob, BlobStore, BlobWriter

PAUSES_S = (0.2, 0.5, 1.0, 2.0)
"""Seconds before each further try after a cut."""
OK, PARTIAL, NOT_MODIFIED, NOT_SATISFIABLE = 200, 206, 304, 416
READABLE_ENCODINGS = ("", "identity", "gzip")
"""What is stored as it comes; a gzip file is expanded, within bounds, by the reader of formats."""
_RANGE = re.compile(r"bytes ([0-9]{1,18})-[0-9]{1,18}/(?:([0-9]{1,18})|\*)")
_LENGTH = re.compile(r"[0-9]{1,18}")


@dataclass(frozen=True, slots=True)
class Part:
    """What has come before the connection was cut, beside the bytes."""

    url: Url
    validator: str | None
    """Strong: it promises that the rest belongs to the same file."""


class Download:
    """`run` it once."""

    def __init__(
        self,
        door: OutboundClient,
        blobs: BlobStore,
        known: HttpCache,
        *,
        bounds: TransferLimits,
        max_bytes: int,
    ) -> None:
        self._door = door
        self._blobs = blobs
        self._known = known
        self._watch = TransferDeadline(bounds)
        self._max_bytes = max_bytes
        self._part: Part | None = None
        self._asked: dict[str, CachedFile] = {}
        self._names: dict[Url, str] = {}

    def run(self, url: Url, name: str | None = None) -> Blob:
        """Store what the URL gives; `name` is what it is remembered by, if not by itself.

        Raises
        ------
        AddressRefusedError, FetchError
            It could not be had.
        """
        if name is not None:
            self._names[url] = name
        with self._blobs.writer() as writer:
            for pause_s in PAUSES_S:
                try:
                    return self._try(url, writer)
                except (FetchCutError, FetchUnreachableError):
                    if self._part is None:
                        raise  # nothing has come yet
                time.sleep(min(pause_s, self._watch.wait()))
            return self._try(url, writer)

    def _try(self, url: Url, writer: BlobWriter) -> Blob:
        with follow(self._door, url, self._watch, self._headers(writer.size)) as answer:
            if answer.status == NOT_MODIFIED and self._name(answer.url) in self._asked:
                return self._asked[self._name(answer.url)].blob
            self._begin(answer, writer)
            validators = Validators.of(answer.headers)
            self._part = Part(answer.url, validators.strong)
            for chunk in answer.chunks:
                writer.write(chunk)
                self._check_size(writer.size)
        blob = writer.commit()
        self._known.keep(self._name(answer.url), CachedFile(blob, validators))
        return blob

    def _headers(self, size: int) -> Callable[[Url], dict[str, str]]:
        def headers_for(url: Url) -> dict[str, str]:
            plain = {"Accept-Encoding": "identity"}
            part = self._part
            if part is not None:
                if part.url != url or part.validator is None or size == 0:
                    return plain
                return plain | {"Range": f"bytes={size}-", "If-Range": part.validator}
            known = self._known.find(self._name(url))
            if known is None:
                return plain
            self._asked[self._name(url)] = known
            return plain | known.validators.conditions

        return headers_for

    def _begin(self, answer: OutboundResponse, writer: BlobWriter) -> None:
        """Go on where the answer does, or begin again."""
        if answer.status == NOT_SATISFIABLE and self._part is not None:
            self._give_up_part(answer.url)
        if answer.status not in (OK, PARTIAL):
            raise FetchStatusError(f"The URL answered {answer.status} instead of 200.")
        encoding = answer.headers.get("content-encoding", "").strip().lower()
        if encoding not in READABLE_ENCODINGS:
            raise FetchError("The URL's file is compressed in a way that was not asked for.")
        if answer.status == PARTIAL or "content-range" in answer.headers:
            self._go_on(answer, writer)
            return
        length = _LENGTH.fullmatch(answer.headers.get("content-length", ""))
        self._check_size(int(length[0]) if length else 0)
        writer.restart()

    def _go_on(self, answer: OutboundResponse, writer: BlobWriter) -> None:
        found = _RANGE.fullmatch(answer.headers.get("content-range", ""))
        if self._part is None or found is None:
            raise FetchError("The URL gave a part of a file that was not asked for.")
        part = Part(answer.url, Validators.of(answer.headers).strong)
        if int(found[1]) != writer.size or part != self._part:
            self._give_up_part(answer.url)  # some servers heed Range, but not If-Range
        self._check_size(int(found[2] or 0))

    def _give_up_part(self, url: Url) -> None:
        self._part = Part(url, None)
        raise FetchCutError("The rest of the URL's file does not fit what came before.")

    def _check_size(self, size: int) -> None:
        if size > self._max_bytes:
            raise FetchTooLargeError(
                f"The URL gives more than the allowed {self._max_bytes} bytes."
            )

    def _name(self, url: Url) -> str:
        return self._names.get(url, str(url))
