"""MATLAB files of version 5 to 7.2 (.mat): matrices by their names; 7.3 is HDF5."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from math import prod
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import DecodedCloud, ReadLimits, check_count
from service.formats.errors import (
    CloudFileError,
    FileLimitError,
    MalformedFileError,
    TruncatedFileError,
)
from service.formats.memory_map import map_file
from service.formats.named_arrays import cloud_of_arrays

MAGIC = b"MATLAB 5.0 MAT-file"
_HEADER_BYTES = 128
_TYPES = {
    1: "i1",
    2: "u1",
    3: "i2",
    4: "u2",
    5: "i4",
    6: "u4",
    7: "f4",
    9: "f8",
    12: "i8",
    13: "u8",
}
"""NumPy's types by the numbers of the elements."""
_MATRIX, _COMPRESSED = 14, 15
_STRUCT = 2
_CLASSES = range(6, 16)
"""Classes of matrices of numbers."""
_COMPLEX = 0x08
_MAX_MATRICES = 1000
_MAX_LENGTH, _MAX_DIMENSIONS = 1 << 31, 4
"""Bounds of a matrix; NumPy takes lengths together also where one of them is 0."""
_MAX_DEPTH = 4
"""Levels of structures within structures."""
_VALUES_PER_POINT = 16
"""Numbers of a matrix for each point of the limit."""
_MIN_ALLOWED_BYTES = 1 << 20
"""Expanded bytes that are allowed whatever the ratio; ratios of small files say nothing."""

Matrices = dict[str, Callable[[], NDArray[np.generic]]]


def sniff(head: bytes) -> bool:
    """Whether it begins as MATLAB writes it."""
    return head.startswith(MAGIC)


def read(
    path: Path,
    limits: ReadLimits,
    weights: str | None = None,
    array: str | None = None,
    *,
    attributes: bool = False,
) -> DecodedCloud:
    """Read the matrix called points, xyz, ..., or the only one, also within structures.

    `array` names another matrix of points. `weights` names a matrix to keep as an attribute;
    `attributes` keeps all with one number or a few for each point.

    Raises
    ------
    CloudFileError
        The file is damaged, or its matrices have other names, shapes or types.
    """
    content = map_file(path)
    if len(content) < _HEADER_BYTES:
        raise TruncatedFileError(f"byte {len(content)}: the file ends within its header")
    mark = bytes(content[126:128])
    if mark not in (b"IM", b"MI"):
        raise MalformedFileError(f"byte 126: {mark!r}; expected IM or MI, the order of the bytes")
    reader = _Reader("<" if mark == b"IM" else ">", limits)
    matrices: Matrices = {}
    try:
        for kind, data in reader.iter_elements(content[_HEADER_BYTES:]):
            if kind == _COMPRESSED:
                data = reader.expand(data)
                kind, data = next(reader.iter_elements(data))
            if kind == _MATRIX:
                reader.collect(data, matrices)
    except CloudFileError:
        raise
    except (struct.error, ValueError, StopIteration, IndexError, zlib.error) as error:
        raise MalformedFileError(f"the MATLAB file is damaged: {error}"[:300]) from None
    if not matrices:
        raise MalformedFileError(
            "the file holds no matrix of numbers; objects as pointCloud are not read: save "
            "their Location"
        )
    return cloud_of_arrays(matrices, "matlab", weights, array, attributes=attributes)


@dataclass(frozen=True, slots=True)
class _Reader:
    order: str
    """Byte order in NumPy's notation."""
    limits: ReadLimits

    def iter_elements(self, content: memoryview) -> Iterator[tuple[int, memoryview]]:
        """Yield type and data of consecutive elements.

        Raises
        ------
        TruncatedFileError
            The last element is not complete.
        """
        at = 0
        while at + 8 <= len(content):
            kind, size = struct.unpack_from(f"{self.order}II", content, at)
            if kind >> 16:  # both in four bytes, and the data in the next four
                kind, size, start, end = kind & 0xFFFF, kind >> 16, at + 4, at + 8
            else:
                start = at + 8
                end = start + size + (-size % 8 if kind != _COMPRESSED else 0)
            if size > len(content) - start:
                raise TruncatedFileError(
                    f"an element announces {size} bytes, of which {len(content) - start} follow"
                )
            yield kind, content[start : start + size]
            at = end

    def expand(self, data: memoryview) -> memoryview:
        """Expand a compressed element within the limit."""
        allowed = max(_MIN_ALLOWED_BYTES, self.limits.max_expansion * len(data))
        allowed = min(allowed, _VALUES_PER_POINT * 8 * self.limits.max_points)
        machine = zlib.decompressobj()
        expanded = machine.decompress(data, allowed)
        if machine.unconsumed_tail:
            raise FileLimitError(
                f"a matrix expands to more than {allowed} bytes, the limit for its size and the "
                "memory allowed"
            )
        return memoryview(expanded)

    def collect(
        self, data: memoryview, matrices: Matrices, folder: str = "", field: str = ""
    ) -> None:
        """Add a matrix of numbers, or those of a structure, under their names."""
        if len(matrices) > _MAX_MATRICES or folder.count(".") > _MAX_DEPTH:
            raise FileLimitError(
                f"more than {_MAX_MATRICES} matrices, or structures in {_MAX_DEPTH} others"
            )
        if len(data) == 0:
            return
        parts = self.iter_elements(data)
        flags = self._numbers(*next(parts))
        shape = tuple(int(length) for length in self._numbers(*next(parts)))
        if not all(0 <= length < _MAX_LENGTH for length in shape) or len(shape) > _MAX_DIMENSIONS:
            raise MalformedFileError(f"a matrix of shape {shape[:9]}; expected rows and columns")
        _, text = next(parts)
        name = folder + (field or bytes(text).decode("latin1"))
        kind = int(flags[0]) & 0xFF
        if kind == _STRUCT and prod(shape) == 1:
            self._collect_fields(parts, name, matrices)
        elif kind in _CLASSES and not int(flags[0]) >> 8 & _COMPLEX:
            check_count(-(-prod(shape) // _VALUES_PER_POINT), 0, 0, repr(name[:80]), self.limits)
            matrices[name] = partial(self._matrix, *next(parts), shape)

    def _collect_fields(
        self, parts: Iterator[tuple[int, memoryview]], name: str, matrices: Matrices
    ) -> None:
        width = int(self._numbers(*next(parts))[0])
        _, text = next(parts)
        names = [
            bytes(text[i : i + width]).split(b"\0")[0].decode("latin1")
            for i in range(0, len(text), max(1, width))
        ]
        for field, (kind, data) in zip(names, parts, strict=False):
            if kind == _MATRIX:
                self.collect(data, matrices, f"{name}.", field)

    def _numbers(self, kind: int, data: memoryview) -> NDArray[np.generic]:
        if kind not in _TYPES:
            raise MalformedFileError(f"an element of type {kind}; expected numbers")
        dtype = np.dtype(self.order + _TYPES[kind])
        return np.frombuffer(data, dtype, len(data) // dtype.itemsize)

    def _matrix(self, kind: int, data: memoryview, shape: tuple[int, ...]) -> NDArray[np.generic]:
        numbers = self._numbers(kind, data)
        if len(numbers) != prod(shape):
            raise MalformedFileError(f"a matrix of shape {shape} holds {len(numbers)} numbers")
        native = numbers.astype(numbers.dtype.newbyteorder("="))
        return native.reshape(shape, order="F")
