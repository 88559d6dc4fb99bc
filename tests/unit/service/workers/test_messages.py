"""Messages survive the pipe, and nothing but a valid message comes out of it."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.workers.messages import (
    MAX_MESSAGE_BYTES,
    MAX_TEXT_LENGTH,
    MAX_WARNINGS,
    Exported,
    Failed,
    Fetched,
    FetchedFile,
    Message,
    MessageError,
    Problem,
    Progress,
    Ready,
    Succeeded,
    clip,
    decode,
    encode,
)

FILE = FetchedFile("ab" * 32, '"1"', None, is_cached=False)
PROBLEM = Problem("urn:mpe:problem:job-memory", "Too large", 507, "source: é\u2028\x00")
MESSAGES = [
    Ready(),
    Progress("decode", 0.05),
    Fetched(FILE, None, {"fetch_s": 1.5}),
    Succeeded(0.9, ["odd"], {"decode_s": 0.0, "store_s": 2e-5}),
    Exported(),
    Failed(PROBLEM, {}),
]


@pytest.mark.parametrize("message", MESSAGES, ids=lambda message: message.kind)
def test_a_message_survives_the_round_trip(message: Message) -> None:
    line = encode(message)
    assert decode(line) == message
    assert line.count(b"\n") == 1
    assert line.endswith(b"\n")


def changed(message: Message, **values: Any) -> bytes:
    return json.dumps(asdict(message) | values).encode()


@pytest.mark.parametrize(
    "line",
    [
        b"",
        b"null",
        b"[]",
        b"{}",
        b'{"kind": "ready"',
        b'{"kind": "ready"} {}',
        b'{"kind": "\xff"}',
        b'{"kind": "\\ud800"}',
        b"[" * 100_000,
        b'{"kind": "restart"}',
        b'{"kind": ["ready"]}',
        b'{"stage": 3}',
        changed(MESSAGES[0], extra=1),
        changed(MESSAGES[1], stage=3),
        changed(MESSAGES[1], stage="x" * 41),
        changed(MESSAGES[1], stage="de code"),
        changed(MESSAGES[1], stage="decode\n"),
        changed(MESSAGES[1], fraction=1.01),
        changed(MESSAGES[1], fraction=-0.01),
        changed(MESSAGES[1], fraction="0.5"),
        changed(MESSAGES[1], fraction=float("nan")),
        changed(MESSAGES[1], fraction=float("inf")),
        changed(MESSAGES[2], source=asdict(FILE) | {"key": "../../../etc/passwd"}),
        changed(MESSAGES[2], source=asdict(FILE) | {"key": "AB" * 32}),
        changed(MESSAGES[2], source=asdict(FILE) | {"etag": "x" * 1000}),
        changed(MESSAGES[2], source=asdict(FILE) | {"is_cached": 1}),
        changed(MESSAGES[2], timing={"fetch_s": -1}),
        changed(MESSAGES[2], timing={"fetch_s": float("nan")}),
        changed(MESSAGES[2], timing={"../": 1}),
        changed(MESSAGES[2], timing={f"s{i}": 1 for i in range(41)}),
        changed(MESSAGES[3], result="ab" * 32),
        changed(MESSAGES[3], confidence=2),
        changed(MESSAGES[3], warnings="odd"),
        changed(MESSAGES[3], warnings=["x" * (MAX_TEXT_LENGTH + 1)]),
        changed(MESSAGES[3], warnings=["x"] * (MAX_WARNINGS + 1)),
        changed(MESSAGES[5], problem={"detail": "x"}),
        changed(MESSAGES[5], problem=asdict(PROBLEM) | {"status": 200}),
        changed(MESSAGES[5], problem=asdict(PROBLEM) | {"type": "http://elsewhere"}),
        changed(MESSAGES[5], problem=asdict(PROBLEM) | {"type": "urn:mpe:problem:invented"}),
        changed(MESSAGES[5], problem=asdict(PROBLEM) | {"detail": "x" * (MAX_TEXT_LENGTH + 1)}),
    ],
    ids=lambda line: line[:40].decode("latin1"),
)
def test_nonsense_is_refused_without_being_repeated(line: bytes) -> None:
    with pytest.raises(MessageError) as refused:
        decode(line)
    assert len(str(refused.value)) < 100


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=20,
)
KINDS = st.sampled_from([message.kind for message in MESSAGES])
FIELDS = st.sampled_from(sorted({name for message in MESSAGES for name in asdict(message)}))
DOCUMENTS = JSON | st.builds(
    lambda kind, values: values | {"kind": kind}, KINDS, st.dictionaries(FIELDS, JSON)
)


@settings(deadline=None)
@given(DOCUMENTS)
def test_any_json_is_a_message_or_the_one_error(document: Any) -> None:
    is_message_or_error(json.dumps(document).encode())


@settings(deadline=None)
@given(st.binary())
def test_any_bytes_are_a_message_or_the_one_error(line: bytes) -> None:
    is_message_or_error(line)


def is_message_or_error(line: bytes) -> None:
    try:
        message = decode(line)
    except MessageError:
        return
    assert decode(encode(message)) == message


@settings(deadline=None)
@given(st.text(st.characters(), max_size=2 * MAX_TEXT_LENGTH))
def test_a_clipped_text_can_be_sent(text: str) -> None:
    message = Failed(Problem(PROBLEM.type, "", 500, clip(text)), {})
    assert decode(encode(message)) == message


def test_the_longest_message_fits() -> None:
    worst = [clip("\x01" * 2 * MAX_TEXT_LENGTH)] * MAX_WARNINGS
    line = encode(Succeeded(1.0, worst, {}))
    assert len(line) < MAX_MESSAGE_BYTES
    decode(line)
