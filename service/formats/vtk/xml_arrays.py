"""Arrays in the XML of VTK: text, base64, or appended bytes, in compressed blocks or not."""

from __future__ import annotations

import base64
import binascii
import lzma
import zlib
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from service.formats.column_types import restore_type
from service.formats.decoded_cloud import ReadLimits
from service.formats.errors import (
    CloudFileError,
    FileLimitError,
    MalformedFileError,
    TruncatedFileError,
    UnsupportedFileError,
    short_reason,
)

_TYPES = {
    **{"Int8": "i1", "Int16": "i2", "Int32": "i4", "Int64": "i8", "Float32": "f4"},
    **{"UInt8": "u1", "UInt16": "u2", "UInt32": "u4", "UInt64": "u8", "Float64": "f8"},
}
"""NumPy's types by those of VTK."""
_MAX_LZMA_BYTES = 256 << 20
"""Memory of the decoder; the highest preset needs 65 MB."""
_DECOMPRESSORS: dict[str, Callable[[], Any]] = {
    "vtkZLibDataCompressor": zlib.decompressobj,
    "vtkLZMADataCompressor": partial(lzma.LZMADecompressor, memlimit=_MAX_LZMA_BYTES),
}
_MAX_BLOCKS = 1 << 20
_MAX_BYTES_PER_POINT = 128
"""Bytes of an array for each point of the limit; the corners of closed meshes have 48 a vertex."""


class ArrayReader:
    """Decodes arrays as the root element says."""

    def __init__(
        self, root: ElementTree.Element, appended: bytes, limits: ReadLimits, *, is_raw: bool
    ) -> None:
        compressor = root.get("compressor", "")
        if compressor and compressor not in _DECOMPRESSORS:
            raise UnsupportedFileError(
                f"blocks compressed by {compressor[:40]!r}; expected "
                f"{' or '.join(_DECOMPRESSORS)}: save it with zlib, or uncompressed"
            )
        self._is_compressed = bool(compressor)
        self._decompressor = _DECOMPRESSORS.get(compressor, zlib.decompressobj)
        self._order = ">" if root.get("byte_order") == "BigEndian" else "<"
        self._word = 8 if root.get("header_type") == "UInt64" else 4
        self._appended, self._is_raw, self._limits = memoryview(appended), is_raw, limits

    def read(self, array: ElementTree.Element, width: int) -> NDArray[np.generic]:
        """Return the numbers (N, width) of an array in their native type.

        Raises
        ------
        CloudFileError
            The array is damaged, or not of numbers.
        """
        kind, form = array.get("type", ""), array.get("format", "")
        if kind not in _TYPES:
            raise UnsupportedFileError(f"an array of type {kind[:40]!r}; expected numbers")
        try:
            if form == "ascii":
                wanted = np.float64 if kind.startswith("Float") else np.int64
                text = (array.text or "").split()
                numbers = restore_type(np.array(text, wanted), _TYPES[kind])
            else:
                content = b"".join(self._blocks(array, form))
                stored = np.frombuffer(content, self._order + _TYPES[kind])
                numbers = stored.astype(_TYPES[kind])
        except (ValueError, OverflowError, binascii.Error, zlib.error, lzma.LZMAError) as error:
            if isinstance(error, CloudFileError):
                raise
            reason = short_reason(error)
            raise MalformedFileError(f"an array cannot be decoded: {reason}") from None
        if len(numbers) % width:
            raise MalformedFileError(f"{len(numbers)} numbers are no rows of {width}")
        return numbers.reshape(-1, width)

    def _blocks(self, array: ElementTree.Element, form: str) -> Iterator[bytes]:
        if form == "appended":
            offset = int(array.get("offset", "0"))
            stream = _Stream(self._appended[max(0, offset) :], is_raw=self._is_raw)
        elif form == "binary":
            text = "".join((array.text or "").split())
            stream = _Stream(memoryview(text.encode("ascii", "replace")), is_raw=False)
        else:
            raise MalformedFileError(f"an array of format {form[:40]!r}")
        if not self._is_compressed:
            (size,) = self._words(stream.peek(self._word))
            yield stream.take(self._word + size)[self._word :]
            return
        if self._words(stream.peek(self._word)) == [0]:
            return
        count, size, last = self._words(stream.peek(3 * self._word))
        if count > _MAX_BLOCKS:
            raise MalformedFileError(f"{count} compressed blocks; the limit is {_MAX_BLOCKS}")
        packed = self._words(stream.take((3 + count) * self._word))[3:]
        most = _MAX_BYTES_PER_POINT * self._limits.max_points
        if count * size > most:
            raise FileLimitError(f"an array of {count * size} bytes; the limit is {most}")
        content = stream.take(sum(packed))
        start = 0
        for number, length in enumerate(packed):
            whole = last if last and number == count - 1 else size
            block = self._decompressor().decompress(content[start : start + length], whole)
            if len(block) < whole:
                raise TruncatedFileError(f"block {number} has {len(block)} of {whole} bytes")
            yield block
            start += length

    def _words(self, content: bytes) -> list[int]:
        return [int(word) for word in np.frombuffer(content, f"{self._order}u{self._word}")]


class _Stream:
    """Bytes, or pieces of base64 one after the other."""

    def __init__(self, content: memoryview, *, is_raw: bool) -> None:
        self._content, self._is_raw, self._at = content, is_raw, 0

    def peek(self, count: int) -> bytes:
        """Return the next bytes without taking them."""
        return self._decode(count)[0]

    def take(self, count: int) -> bytes:
        """Return the next bytes, which are a piece of their own."""
        found, length = self._decode(count)
        self._at += length
        return found

    def _decode(self, count: int) -> tuple[bytes, int]:
        length = count if self._is_raw else (count + 2) // 3 * 4
        piece = self._content[self._at : self._at + length]
        if len(piece) < length:
            raise TruncatedFileError(f"{count} bytes are announced, {len(piece)} follow")
        return (bytes(piece) if self._is_raw else base64.b64decode(piece)[:count]), length
