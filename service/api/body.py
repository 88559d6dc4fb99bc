"""Reading a request's body piece by piece, never more than is allowed, clouds straight to disk."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable
from typing import Self, TypeVar

from fastapi import Request
from python_multipart.exceptions import FormParserError
from python_multipart.multipart import MultipartParser, parse_options_header
from starlette.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect

from service.problems import BodyTooLargeError, MalformedBodyError
from service.storage.blobs import Blob, BlobStore, BlobWriter

MAX_PARTS = 16
MAX_TEXT_BYTES = 1 << 18

Fields = dict[str, Blob | str]
Understood = TypeVar("Understood")


async def limited(request: Request, limit: int) -> AsyncIterator[bytes]:
    """The body's chunks; BodyTooLargeError as soon as it is known to exceed the limit."""
    received = int(request.headers.get("content-length", 0))
    if received > limit:
        raise _too_large(limit)
    received = 0
    try:
        async for chunk in request.stream():
            received += len(chunk)
            if received > limit:
                raise _too_large(limit)
            yield chunk
    except ClientDisconnect:
        raise MalformedBodyError("The connection was cut before the body had arrived.") from None


def _too_large(limit: int) -> BodyTooLargeError:
    return BodyTooLargeError(f"The body exceeds the allowed {limit} bytes.")


async def read_text(request: Request) -> bytes:
    """The whole of a small body."""
    return b"".join([chunk async for chunk in limited(request, MAX_TEXT_BYTES)])


async def read_file(request: Request, blobs: BlobStore, limit: int) -> Blob:
    """The body, stored as it is."""
    with blobs.writer() as writer:
        async for chunk in limited(request, limit):
            writer.write(chunk)
        return await run_in_threadpool(writer.commit)


async def read_multipart(
    request: Request, blobs: BlobStore, limit: int, understand: Callable[[Fields], Understood]
) -> Understood:
    """What is understood from the fields of a multipart/form-data body, in the thread that stores
    its files: they are blobs by then, the other fields text."""
    _, parameters = parse_options_header(request.headers["content-type"])
    with _Form(parameters.get(b"boundary", b""), blobs) as form:
        async for chunk in limited(request, limit):
            form.feed(chunk)
        return await run_in_threadpool(lambda: understand(form.finish()))


class _Form:
    """Takes the parser's callbacks; a file goes to its blob writer while it arrives."""

    def __init__(self, boundary: bytes, blobs: BlobStore) -> None:
        if not boundary:
            raise MalformedBodyError("The content type multipart/form-data names no boundary.")
        self._blobs = blobs
        self._fields: dict[str, BlobWriter | bytearray] = {}
        self._current: BlobWriter | bytearray = bytearray()
        self._header: tuple[bytes, bytes] = (b"", b"")
        self._disposition: dict[bytes, bytes] = {}
        self._complete = False
        self._parser = MultipartParser(
            boundary,
            {
                "on_part_begin": self._begin_part,
                "on_header_field": self._header_name,
                "on_header_value": self._header_value,
                "on_header_end": self._end_header,
                "on_headers_finished": self._open_field,
                "on_part_data": self._data,
                "on_end": self._end,
            },
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for field in self._fields.values():
            if isinstance(field, BlobWriter):
                field.discard()

    def feed(self, chunk: bytes) -> None:
        try:
            self._parser.write(chunk)
        except FormParserError as error:
            raise MalformedBodyError(f"The multipart body is malformed: {error}") from error

    def finish(self) -> Fields:
        """Make the files durable; called off the event loop, it waits for the disk."""
        if not self._complete:
            raise MalformedBodyError("The multipart body ends before its closing boundary.")
        try:
            return {
                name: field.commit() if isinstance(field, BlobWriter) else field.decode()
                for name, field in self._fields.items()
            }
        except UnicodeDecodeError as error:
            raise MalformedBodyError("A text field of the form is not UTF-8.") from error

    def _begin_part(self) -> None:
        self._header, self._disposition = (b"", b""), {}

    def _header_name(self, data: bytes, start: int, end: int) -> None:
        name, value = self._header
        self._header = (name + data[start:end], value)

    def _header_value(self, data: bytes, start: int, end: int) -> None:
        name, value = self._header
        self._header = (name, value + data[start:end])

    def _end_header(self) -> None:
        name, value = self._header
        if name.lower() == b"content-disposition":
            _, self._disposition = parse_options_header(value)
        self._header = (b"", b"")

    def _open_field(self) -> None:
        name = self._disposition.get(b"name", b"").decode(errors="replace")
        if not name:
            raise MalformedBodyError("A part of the form has no name.")
        if name in self._fields:
            raise MalformedBodyError("A field of the form comes twice.")
        if len(self._fields) >= MAX_PARTS:
            raise MalformedBodyError(f"The form has more than {MAX_PARTS} fields.")
        is_file = b"filename" in self._disposition
        self._current = self._blobs.writer() if is_file else bytearray()
        self._fields[name] = self._current

    def _data(self, data: bytes, start: int, end: int) -> None:
        if isinstance(self._current, BlobWriter):
            self._current.write(data[start:end])
            return
        self._current += data[start:end]
        if len(self._current) > MAX_TEXT_BYTES:
            raise BodyTooLargeError(f"A text field exceeds the allowed {MAX_TEXT_BYTES} bytes.")

    def _end(self) -> None:
        self._complete = True
