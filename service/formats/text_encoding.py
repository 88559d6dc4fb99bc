"""Text in UTF-16, with a byte order mark, CR alone or signs of typesetters, rewritten plainly."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from service.formats.decoded_cloud import ReadLimits
from service.formats.disk import check_disk

_MARKS = {b"\xff\xfe": "utf-16-le", b"\xfe\xff": "utf-16-be"}
_UTF8_MARK = b"\xef\xbb\xbf"
_TYPESET = {"\u00a0": " ", "\u2009": " ", "\u202f": " ", "\u2212": "-"}
"""Blanks and minus signs of word processors, and what is meant."""
_CONTROL = re.compile(rb"[\0-\x08\x0e-\x19\x1b\x7f]")
"""Bytes that are in no text: those of numbers look like CR too."""
_BLOCK_CHARACTERS = 1 << 20
_MIN_SHARE = 0.9
"""Share of zero bytes at every other place from which on text without a mark is UTF-16."""
_HEAD_BYTES = 4096
_MAX_GROWTH = 2
"""Bytes of the text as it is written, at most, for one byte of the file."""


def decode_line(raw: bytes) -> str:
    """Return a line or a header as text: UTF-8, or else Latin-1."""
    try:
        return raw.decode("utf8")
    except UnicodeDecodeError:
        return raw.decode("latin1")


def decode_lines(raw: bytes) -> list[str]:
    """Return the lines between LF as text, each in the encoding that fits it."""
    return [decode_line(line) for line in raw.split(b"\n")]


def to_plain_head(head: bytes) -> bytes:
    """Return the first bytes of a text as they are after `rewrite_text`."""
    if (encoding := _find_encoding(head)) is not None:
        text = head[: len(head) // 2 * 2].decode(encoding, errors="replace")
        head = text.removeprefix("\ufeff").encode()
    head = head.removeprefix(_UTF8_MARK)
    if _is_typeset(head):
        for sign, plain in _TYPESET.items():
            head = head.replace(sign.encode(), plain.encode())
    return head.replace(b"\r", b"\n") if _has_cr_alone(head) else head


@contextmanager
def rewrite_text(path: Path, limits: ReadLimits) -> Iterator[tuple[Path, tuple[str, ...]]]:
    """Provide the text in UTF-8 with line ends of LF, and warnings of what was rewritten.

    Raises
    ------
    OSError
        With ENOSPC: too little of the disk would be left.
    """
    with path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
    if to_plain_head(head) == head:
        yield path, ()
        return
    encoding = _find_encoding(head)
    warnings = (f"the text is in {encoding.upper()}",) if encoding else ()
    with tempfile.TemporaryDirectory(prefix="text-") as folder:
        plain = Path(folder) / "text"
        check_disk(plain.parent, _MAX_GROWTH * path.stat().st_size, limits)
        is_utf8 = head.startswith(_UTF8_MARK) or _is_typeset(head)
        _rewrite(path, plain, encoding or ("utf-8-sig" if is_utf8 else None))
        yield plain, warnings


def _rewrite(path: Path, plain: Path, encoding: str | None) -> None:
    with (
        path.open(encoding=encoding or "latin1", errors="replace", newline=None) as source,
        plain.open("w", encoding="utf8" if encoding else "latin1", newline="\n") as target,
    ):
        is_first = True
        signs = str.maketrans(_TYPESET)
        while block := source.read(_BLOCK_CHARACTERS):
            block = block.translate(signs) if encoding else block
            target.write(block.removeprefix("\ufeff") if is_first else block)
            is_first = False


def _is_typeset(head: bytes) -> bool:
    """Whether it is text in UTF-8 with blanks or minus signs of word processors."""
    if b"\0" in head or not any(sign.encode() in head for sign in _TYPESET):
        return False
    return "\ufffd" not in head.decode("utf8", errors="replace")[:-1]


def find_line_end(head: bytes) -> bytes:
    """Return what ends the first line: LF, alone or after CR, or CR alone."""
    end = head.find(b"\r")
    is_alone = 0 <= end < len(head) - 1 and head[end + 1 : end + 2] != b"\n"
    return b"\r" if is_alone and b"\n" not in head[:end] else b"\n"


def _has_cr_alone(head: bytes) -> bool:
    is_text = not _CONTROL.search(head)
    return b"\n" not in head and is_text and b"\r" in head.rstrip(b"\r")


def _find_encoding(head: bytes) -> str | None:
    """Return the encoding by its mark over half of zeros, or by zeros at every other place."""
    marked = _MARKS.get(head[:2])
    if marked is not None:
        return marked if 3 * head.count(0) >= len(head) else None
    half = len(head) // 2
    if half < 8:
        return None
    for zeros, encoding in ((head[1::2], "utf-16-le"), (head[::2], "utf-16-be")):
        if zeros.count(0) >= _MIN_SHARE * half and head.count(0) - zeros.count(0) == 0:
            return encoding
    return None
