"""XML files of VTK (.vtp, .vtu, .vts): the points of poly data and of grids.

Arrays are text, base64, or appended bytes; blocks of bytes may be compressed by zlib.
"""

from __future__ import annotations

import base64
import binascii
import re
import zlib
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import DecodedCloud, ReadLimits, check_count
from service.formats.errors import (
    FileLimitError,
    MalformedFileError,
    TruncatedFileError,
    UnsupportedFileError,
    short_reason,
)

_MAX_XML_BYTES = 512 << 20
_KINDS = ("PolyData", "UnstructuredGrid", "StructuredGrid")
_TYPES = {"Float32": "f4", "Float64": "f8", "Int32": "i4", "Int64": "i8", "Int16": "i2"}
_APPENDED = re.compile(rb"<AppendedData[^>]{0,200}>[ \t\r\n]{0,100}_")
_MAX_BLOCKS = 1 << 20


def sniff(head: bytes) -> bool:
    """Whether it is XML with the root element VTKFile."""
    start = head.lstrip()[:2000]
    return start.startswith(b"<") and b"<VTKFile" in start


def read(path: Path, limits: ReadLimits, *, attributes: bool = False) -> DecodedCloud:
    """Read the points of all pieces; `attributes` are not read, which a warning says.

    Raises
    ------
    CloudFileError
        The file is damaged, or of a kind without points of its own.
    """
    if path.stat().st_size > _MAX_XML_BYTES:
        raise FileLimitError(f"VTK in XML of more than {_MAX_XML_BYTES} bytes: save it as PLY")
    content = path.read_bytes()
    found = _APPENDED.search(content)
    root = _parse(content if found is None else content[: found.start()] + b"</VTKFile>")
    kind = root.get("type", "")
    if kind not in _KINDS:
        raise UnsupportedFileError(
            f"VTK of type {kind[:40]!r}; expected one of {', '.join(_KINDS)}: save it as poly data"
        )
    arrays = [item for points in root.iter("Points") for item in points.iter("DataArray")]
    if not arrays:
        raise MalformedFileError("the file has no points")
    appended = b"" if found is None else content[found.end() :]
    is_raw = found is not None and b'"raw"' in found[0]
    reader = _ArrayReader(root, appended, limits, is_raw=is_raw)
    parts = [reader.read(item) for item in arrays]
    warnings = ("cells and attributes of VTK are not kept",) if attributes else ()
    return DecodedCloud(np.concatenate(parts), "vtp", warnings)


def _parse(xml: bytes) -> ElementTree.Element:
    """Parse XML without document type and entities."""
    if re.search(rb"<!\s*(DOCTYPE|ENTITY)", xml) or b"\0" in xml[:1000]:
        raise UnsupportedFileError("the XML declares a document type, or is not in UTF-8")
    try:
        return ElementTree.fromstring(xml)  # noqa: S314  without document type and entities
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise MalformedFileError(f"the XML is not well-formed: {short_reason(error)}") from None


class _ArrayReader:
    """Decodes arrays of coordinates as the root element says."""

    def __init__(
        self, root: ElementTree.Element, appended: bytes, limits: ReadLimits, *, is_raw: bool
    ) -> None:
        compressor = root.get("compressor")
        if compressor not in (None, "vtkZLibDataCompressor"):
            raise UnsupportedFileError(
                f"blocks compressed by {compressor[:40]!r}; expected zlib: save it uncompressed"
            )
        self._is_compressed = compressor is not None
        self._order = ">" if root.get("byte_order") == "BigEndian" else "<"
        self._word = 8 if root.get("header_type") == "UInt64" else 4
        self._appended, self._is_raw, self._limits = appended, is_raw, limits

    def read(self, array: ElementTree.Element) -> NDArray[np.floating]:
        """Return the points (N, 3) of an array."""
        kind, form = array.get("type", ""), array.get("format", "")
        if kind not in _TYPES or array.get("NumberOfComponents") != "3":
            raise MalformedFileError(f"points of type {kind[:40]!r}; expected three numbers each")
        try:
            if form == "ascii":
                numbers = np.array((array.text or "").split(), np.float64)
            else:
                content = b"".join(self._blocks(array, form))
                numbers = np.frombuffer(content, self._order + _TYPES[kind])
        except (ValueError, binascii.Error, zlib.error) as error:
            if isinstance(error, MalformedFileError | FileLimitError | UnsupportedFileError):
                raise
            reason = short_reason(error)
            raise MalformedFileError(f"the points cannot be decoded: {reason}") from None
        if len(numbers) % 3:
            raise MalformedFileError(f"{len(numbers)} numbers are no points of three")
        check_count(len(numbers) // 3, 0, 0, "the points", self._limits)
        points: NDArray[np.floating] = numbers.astype(
            np.float32 if kind == "Float32" else np.float64
        )
        return points.reshape(-1, 3)

    def _blocks(self, array: ElementTree.Element, form: str) -> Iterator[bytes]:
        if form == "appended":
            offset = int(array.get("offset", "0"))
            stream = _Stream(self._appended[offset:] if offset >= 0 else b"", is_raw=self._is_raw)
        elif form == "binary":
            text = "".join((array.text or "").split())
            stream = _Stream(text.encode("ascii", "replace"), is_raw=False)
        else:
            raise MalformedFileError(f"an array of format {form[:40]!r}")
        if not self._is_compressed:
            (size,) = self._words(stream.peek(self._word))
            yield stream.take(self._word + size)[self._word :]
            return
        count, size, last = self._words(stream.peek(3 * self._word))
        if count > _MAX_BLOCKS:
            raise MalformedFileError(f"{count} compressed blocks; the limit is {_MAX_BLOCKS}")
        packed = self._words(stream.take((3 + count) * self._word))[3:]
        if count * size > 24 * self._limits.max_points:
            raise FileLimitError(f"points of {count * size} bytes are too many")
        content = stream.take(sum(packed))
        start = 0
        for number, length in enumerate(packed):
            whole = last if last and number == count - 1 else size
            block = zlib.decompressobj().decompress(content[start : start + length], whole)
            if len(block) < whole:
                raise TruncatedFileError(f"block {number} has {len(block)} of {whole} bytes")
            yield block
            start += length

    def _words(self, content: bytes) -> list[int]:
        return [int(word) for word in np.frombuffer(content, f"{self._order}u{self._word}")]


class _Stream:
    """Bytes, or pieces of base64 one after the other."""

    def __init__(self, content: bytes, *, is_raw: bool) -> None:
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
        return (piece if self._is_raw else base64.b64decode(piece)[:count]), length
