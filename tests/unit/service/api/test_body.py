"""Bodies: limits, multipart forms, and what stays on the disk when they are refused."""

from __future__ import annotations

import asyncio
import hashlib
import threading
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

from service.api.body import (
    MAX_FORM_FIELDS,
    MAX_TEXT_BYTES,
    WRITE_BYTES,
    FormFields,
    iter_body,
    read_multipart,
    read_text,
    store_body,
)
from service.problems import BodyTooLargeError, ConnectionClosedError, MalformedBodyError
from service.storage.blobs import Blob, BlobStore, BlobWriter
from tests.factories.api import FORM_TYPE, form, part, request_of
from tests.factories.threads import note_threads

LIMIT = 10_000


def parsed(root: Path, chunks: Iterable[bytes], headers: dict[str, str] = FORM_TYPE) -> FormFields:
    request = request_of(chunks, headers)
    return asyncio.run(read_multipart(request, BlobStore(root), LIMIT, lambda fields: fields))


def files_in(root: Path) -> list[Path]:
    return [path for path in root.rglob("*") if path.is_file() and path.name != "blobs.lock"]


def split(body: bytes, size: int) -> list[bytes]:
    return [body[start : start + size] for start in range(0, len(body), size)]


@pytest.mark.parametrize("size", [1, 7, 10_000])
def test_a_form_is_the_same_however_its_bytes_are_cut(tmp_path: Path, size: int) -> None:
    body = form(part("source", b"0 1 2\r\n--b", filename="a.xyz"), part("options", b'{"seed": 1}'))
    fields = parsed(tmp_path, split(body, size))
    blob = Blob(hashlib.sha256(b"0 1 2\r\n--b").hexdigest(), 10)
    assert fields == {"source": blob, "options": '{"seed": 1}'}
    assert BlobStore(tmp_path).path(blob.sha256).read_bytes() == b"0 1 2\r\n--b"


@pytest.mark.parametrize("is_form", [True, False])
def test_files_are_written_by_threads(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_form: bool
) -> None:
    """A disk may be slow: the event loop does not wait for it."""
    calls = [
        note_threads(monkeypatch, BlobWriter, name) for name in ("__init__", "write", "discard")
    ]
    content = bytes(3 * WRITE_BYTES)
    body = form(part("source", content, filename="a"), part("target", content, filename="b"))
    request = request_of(split(body if is_form else content, 1000), FORM_TYPE)
    blobs = BlobStore(tmp_path)
    if is_form:
        asyncio.run(read_multipart(request, blobs, 10**6, lambda fields: fields))
    else:
        asyncio.run(store_body(request, blobs, 10**6))
    for writers in calls:
        assert writers
        assert threading.get_ident() not in writers
    assert blobs.path(hashlib.sha256(content).hexdigest()).read_bytes() == content


def test_the_order_of_the_parts_does_not_matter(tmp_path: Path) -> None:
    parts = [part("a", b"1"), part("b", b"2", filename="f"), part("c", b"3")]
    assert parsed(tmp_path, [form(*parts)]) == parsed(tmp_path, [form(*reversed(parts))])


def test_unknown_parts_are_passed_on(tmp_path: Path) -> None:
    """Which names make sense is the submission's business."""
    assert parsed(tmp_path, [form(part("colour", b"red"))]) == {"colour": "red"}


MALFORMED: dict[str, tuple[bytes, str]] = {
    "no closing boundary": (part("source", b"x", filename="a"), "closing boundary"),
    "no name": (b"--b0und\r\nContent-Type: text/plain\r\n\r\nx\r\n--b0und--\r\n", "no name"),
    "the same name twice": (form(part("a", b"1"), part("a", b"2")), "same name"),
    "too many fields": (
        form(*(part(f"f{i}", b"") for i in range(MAX_FORM_FIELDS + 1))),
        f"more than {MAX_FORM_FIELDS}",
    ),
    "text that is not UTF-8": (form(part("a", b"\xff")), "UTF-8"),
    "no multipart body": (b"zzz", "malformed"),
}


@pytest.mark.parametrize(("body", "words"), MALFORMED.values(), ids=MALFORMED)
def test_malformed_forms(tmp_path: Path, body: bytes, words: str) -> None:
    with pytest.raises(MalformedBodyError, match=words):
        parsed(tmp_path, [body])


def test_a_form_needs_a_boundary(tmp_path: Path) -> None:
    with pytest.raises(MalformedBodyError, match="boundary"):
        parsed(tmp_path, [b""], {"Content-Type": "multipart/form-data"})


def test_a_boundary_is_not_longer_than_the_standard_allows(tmp_path: Path) -> None:
    content_type = f"multipart/form-data; boundary={'b' * 10_000}"
    with pytest.raises(MalformedBodyError, match="70"):
        parsed(tmp_path, [b""], {"Content-Type": content_type})


def test_a_costly_form_leaves_turns_to_others(tmp_path: Path) -> None:
    """Near-boundaries are the costliest to parse."""
    chunk = b"\r\n--b0unX\r\n-" * 20_000
    body = form(part("source", chunk, filename="a"))
    turns = 0

    async def count() -> None:
        nonlocal turns
        while True:
            turns += 1
            await asyncio.sleep(0)

    async def run() -> None:
        counting = asyncio.create_task(count())
        request = request_of([body], FORM_TYPE)
        await read_multipart(request, BlobStore(tmp_path), 10 * len(body), dict)
        counting.cancel()

    asyncio.run(run())
    assert turns > 10


def test_a_text_field_is_bounded_by_itself(tmp_path: Path) -> None:
    request = request_of([form(part("options", bytes(MAX_TEXT_BYTES + 1)))], FORM_TYPE)
    reading = read_multipart(request, BlobStore(tmp_path), 10 * MAX_TEXT_BYTES, dict)
    with pytest.raises(BodyTooLargeError, match=str(MAX_TEXT_BYTES)):
        asyncio.run(reading)


REFUSED: list[tuple[list[Any], type[Exception]]] = [
    ([part("source", bytes(LIMIT + 1), filename="a")], BodyTooLargeError),
    ([part("source", b"x", filename="a"), None], ConnectionClosedError),
    ([part("source", b"x", filename="a")], MalformedBodyError),
]


@pytest.mark.parametrize(("chunks", "error"), REFUSED, ids=["long", "cut", "incomplete"])
def test_a_refused_form_leaves_no_file(
    tmp_path: Path, chunks: list[bytes], error: type[Exception]
) -> None:
    with pytest.raises(error):
        parsed(tmp_path, chunks)
    assert files_in(tmp_path) == []


async def _collect(chunks: Iterable[Any], headers: dict[str, str], max_bytes: int) -> bytes:
    return b"".join([chunk async for chunk in iter_body(request_of(chunks, headers), max_bytes)])


def test_a_body_of_just_the_limit_is_read() -> None:
    assert asyncio.run(_collect([b"12", b"345"], {"Content-Length": "5"}, 5)) == b"12345"


@pytest.mark.parametrize("headers", [{"Content-Length": "6"}, {}, {"Content-Length": "1"}])
def test_a_longer_body_is_refused_announced_or_not(headers: dict[str, str]) -> None:
    with pytest.raises(BodyTooLargeError, match="5 bytes"):
        asyncio.run(_collect([b"12", b"3456"], headers, 5))


def test_an_announced_length_is_refused_before_anything_is_read() -> None:
    with pytest.raises(BodyTooLargeError):
        asyncio.run(_collect([None], {"Content-Length": "6"}, 5))


def test_a_cut_connection_is_told_apart_from_a_malformed_body() -> None:
    with pytest.raises(ConnectionClosedError, match="closed"):
        asyncio.run(_collect([b"1", None], {}, 5))


def test_raw_bodies(tmp_path: Path) -> None:
    blob = asyncio.run(store_body(request_of([b"ab", b"c"]), BlobStore(tmp_path), 3))
    assert blob == Blob(hashlib.sha256(b"abc").hexdigest(), 3)
    with pytest.raises(BodyTooLargeError):
        asyncio.run(store_body(request_of([b"abcd"]), BlobStore(tmp_path), 3))
    assert [path.name for path in files_in(tmp_path)] == [blob.sha256]
    with pytest.raises(BodyTooLargeError):
        asyncio.run(read_text(request_of([bytes(MAX_TEXT_BYTES), b"x"])))
