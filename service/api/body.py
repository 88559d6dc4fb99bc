"""Request bodies, read chunk by chunk within limits; files go straight to the blob store.

Starlette's form parser writes every file to a temporary file before a route runs; this one hashes
and stores it while it arrives. Both use the callbacks of python-multipart.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Callable
from typing import TypeVar

from fastapi import Request
from python_multipart.exceptions import FormParserError
from python_multipart.multipart import MultipartParser, parse_options_header
from starlette.requests import ClientDisconnect

from service.api.threads import STORING
from service.problems import BodyTooLargeError, ConnectionClosedError, MalformedBodyError
from service.storage.blobs import Blob, BlobStore, BlobWriter

MAX_FORM_FIELDS = 16
MAX_TEXT_BYTES = 1 << 18
"""Longest JSON body and longest text field of a form, in bytes."""

MAX_BOUNDARY_BYTES = 70
"""Longest boundary of a form (RFC 2046, 5.1.1)."""
STEP_BYTES = 2048
MAX_STEP_S = 0.001
"""A form is parsed in steps; after so many seconds other requests get their turn."""
WRITE_BYTES = 1 << 16
"""Bytes of files that are held until a thread hashes and writes them."""

FormFields = dict[str, Blob | str]
T = TypeVar("T")


async def iter_body(request: Request, max_bytes: int) -> AsyncIterator[bytes]:
    """Yield the chunks of the body.

    Raises
    ------
    BodyTooLargeError
        Content-Length or the bytes received so far exceed `max_bytes`.
    ConnectionClosedError
        The connection is closed before the end of the body.
    """
    if int(request.headers.get("content-length", 0)) > max_bytes:
        raise _too_large(max_bytes)
    received = 0
    try:
        async for chunk in request.stream():
            received += len(chunk)
            if received > max_bytes:
                raise _too_large(max_bytes)
            yield chunk
    except ClientDisconnect:
        raise ConnectionClosedError(
            "The connection was closed before the end of the body."
        ) from None


def _too_large(max_bytes: int) -> BodyTooLargeError:
    return BodyTooLargeError(f"The body is longer than the allowed {max_bytes} bytes.")


async def read_text(request: Request) -> bytes:
    """Read a body of at most MAX_TEXT_BYTES as a whole."""
    return b"".join([chunk async for chunk in iter_body(request, MAX_TEXT_BYTES)])


async def store_body(request: Request, blobs: BlobStore, max_bytes: int) -> Blob:
    """Store the body as a blob."""
    held, file = _HeldBytes(), _ArrivingFile(blobs)
    try:
        async for chunk in iter_body(request, max_bytes):
            held.add(file, chunk)
            await held.write_where_long()

        def commit() -> Blob:
            held.write()
            return file.commit()

        return await STORING.run(commit)
    finally:
        await STORING.run(file.discard)


class _ArrivingFile:
    """A blob that is begun when its first bytes are written; all methods are for threads."""

    def __init__(self, blobs: BlobStore) -> None:
        self._begin = blobs.writer
        self._writer: BlobWriter | None = None

    def write(self, data: bytes | bytearray) -> None:
        self._begun().write(data)

    def commit(self) -> Blob:
        return self._begun().commit()

    def discard(self) -> None:
        if self._writer is not None:
            self._writer.discard()

    def _begun(self) -> BlobWriter:
        if self._writer is None:
            self._writer = self._begin()
        return self._writer


class _HeldBytes:
    """Bytes that wait to be written: a disk may be slow, so a thread does it, not the loop."""

    def __init__(self) -> None:
        self._parts: list[tuple[_ArrivingFile, bytearray]] = []
        self._size = 0

    def add(self, file: _ArrivingFile, data: bytes) -> None:
        if not self._parts or self._parts[-1][0] is not file:
            self._parts.append((file, bytearray()))
        self._parts[-1][1].extend(data)
        self._size += len(data)

    def write(self) -> None:
        for file, data in self._parts:
            file.write(data)
        self._parts, self._size = [], 0

    async def write_where_long(self) -> None:
        if self._size >= WRITE_BYTES:
            await STORING.run(self.write)


async def read_multipart(
    request: Request, blobs: BlobStore, max_bytes: int, parse: Callable[[FormFields], T]
) -> T:
    """Read a multipart/form-data body, store its files, and parse its fields.

    Parameters
    ----------
    request : Request
        Its Content-Type is multipart/form-data.
    blobs : BlobStore
        Where the files go.
    max_bytes : int
        Longest body.
    parse : callable
        Called with the fields by name, files as blobs and other fields as text, in the worker
        thread that makes the files durable.

    Raises
    ------
    MalformedBodyError
        The body is not a complete form with named, distinct fields.
    BodyTooLargeError
        The body, or one of its text fields, is too long.
    """
    _, parameters = parse_options_header(request.headers["content-type"])
    form = _MultipartForm(parameters.get(b"boundary", b""), blobs)
    try:
        async for chunk in iter_body(request, max_bytes):
            await _feed_in_steps(form, chunk)
            await form.held.write_where_long()
        return await STORING.run(lambda: parse(form.commit()))
    finally:
        await STORING.run(form.discard)


async def _feed_in_steps(form: _MultipartForm, chunk: bytes) -> None:
    """Parse a chunk; other requests get their turn before a costly one has taken long."""
    since = time.perf_counter()
    for start in range(0, len(chunk), STEP_BYTES):
        form.feed(chunk[start : start + STEP_BYTES])
        if time.perf_counter() - since > MAX_STEP_S:
            await asyncio.sleep(0)
            since = time.perf_counter()


class _MultipartForm:
    """Receiver of the parser's callbacks; holds what is to be written to the blob store."""

    def __init__(self, boundary: bytes, blobs: BlobStore) -> None:
        if not 1 <= len(boundary) <= MAX_BOUNDARY_BYTES:
            raise MalformedBodyError(
                "The content type multipart/form-data must name a boundary of 1 to "
                f"{MAX_BOUNDARY_BYTES} characters."
            )
        self.held = _HeldBytes()
        self._blobs = blobs
        self._fields: dict[str, _ArrivingFile | bytearray] = {}
        self._field: _ArrivingFile | bytearray = bytearray()
        self._header_name = b""
        self._header_value = b""
        self._disposition: dict[bytes, bytes] = {}
        self._is_complete = False
        self._parser = MultipartParser(
            boundary,
            {
                "on_part_begin": self._on_part_begin,
                "on_header_field": self._on_header_field,
                "on_header_value": self._on_header_value,
                "on_header_end": self._on_header_end,
                "on_headers_finished": self._on_headers_finished,
                "on_part_data": self._on_part_data,
                "on_end": self._on_end,
            },
        )

    def discard(self) -> None:
        """Remove the files that were not committed, which waits for the disk."""
        for field in self._fields.values():
            if isinstance(field, _ArrivingFile):
                field.discard()

    def feed(self, chunk: bytes) -> None:
        try:
            self._parser.write(chunk)
        except FormParserError as error:
            raise MalformedBodyError(f"The multipart body is malformed: {error}") from error

    def commit(self) -> FormFields:
        """Make the files durable, which waits for the disk, and return all fields."""
        if not self._is_complete:
            raise MalformedBodyError("The multipart body ends before its closing boundary.")
        self.held.write()
        try:
            return {
                name: field.commit() if isinstance(field, _ArrivingFile) else field.decode()
                for name, field in self._fields.items()
            }
        except UnicodeDecodeError as error:
            raise MalformedBodyError("A text field of the form is not UTF-8.") from error

    def _on_part_begin(self) -> None:
        self._header_name, self._header_value, self._disposition = b"", b"", {}

    def _on_header_field(self, data: bytes, start: int, end: int) -> None:
        self._header_name += data[start:end]

    def _on_header_value(self, data: bytes, start: int, end: int) -> None:
        self._header_value += data[start:end]

    def _on_header_end(self) -> None:
        if self._header_name.lower() == b"content-disposition":
            _, self._disposition = parse_options_header(self._header_value)
        self._header_name, self._header_value = b"", b""

    def _on_headers_finished(self) -> None:
        name = self._disposition.get(b"name", b"").decode(errors="replace")
        if not name:
            raise MalformedBodyError("A part of the form has no name.")
        if name in self._fields:
            raise MalformedBodyError("Two parts of the form have the same name.")
        if len(self._fields) >= MAX_FORM_FIELDS:
            raise MalformedBodyError(f"The form has more than {MAX_FORM_FIELDS} fields.")
        is_file = b"filename" in self._disposition
        self._field = self._fields[name] = _ArrivingFile(self._blobs) if is_file else bytearray()

    def _on_part_data(self, data: bytes, start: int, end: int) -> None:
        if isinstance(self._field, _ArrivingFile):
            self.held.add(self._field, data[start:end])
            return
        self._field += data[start:end]
        if len(self._field) > MAX_TEXT_BYTES:
            raise BodyTooLargeError(
                f"A text field is longer than the allowed {MAX_TEXT_BYTES} bytes."
            )

    def _on_end(self) -> None:
        self._is_complete = True
