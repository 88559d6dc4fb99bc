"""Rows of a binary PLY element, lists included."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from service.formats.errors import MalformedFileError, TruncatedFileError
from service.formats.ply.header import Element

_FIRST_RUN = 64


def read_rows(
    content: memoryview, offset: int, element: Element, order: str, wanted: Sequence[str]
) -> tuple[NDArray[np.generic], int]:
    """Return the wanted scalar properties (rows, len(wanted)), and the offset behind the last row.

    Rows with lists have no fixed size. Most files repeat the same lengths for long stretches, so
    rows are taken in runs: the lengths in the first row give the layout of its run, which lasts as
    long as the length fields agree.

    Raises
    ------
    TruncatedFileError, MalformedFileError
        With the row and byte at fault.
    """
    runs: list[NDArray[np.generic]] = [np.empty((0, len(wanted)), np.int8)]
    row, longest = 0, element.count if not element.has_lists else _FIRST_RUN
    while row < element.count:
        layout, lengths = _layout_at(content, offset, element, order, row)
        fitting = (len(content) - offset) // layout.itemsize if layout.itemsize else element.count
        if fitting == 0:
            raise _cut(element, row, offset)
        rows = np.frombuffer(content, layout, min(element.count - row, longest, fitting), offset)
        run = _agreeing(rows, lengths)
        if wanted:
            runs.append(np.stack([rows[name][:run] for name in wanted], axis=1))
        row, offset = row + run, offset + run * layout.itemsize
        longest = 2 * run + _FIRST_RUN
    return np.concatenate(runs), offset


def _layout_at(
    content: memoryview, offset: int, element: Element, order: str, row: int
) -> tuple[np.dtype[np.void], dict[str, int]]:
    """Layout of the row at the offset, and the lengths of its lists by their field's name."""
    fields: list[tuple[str, str] | tuple[str, str, tuple[int]]] = []
    lengths: dict[str, int] = {}
    for number, item in enumerate(element.properties):
        if item.count_type:
            at = offset + np.dtype(fields).itemsize
            length = _length(content, at, order + item.count_type, element, row)
            lengths[f"length of {number}"] = length
            fields.append((f"length of {number}", order + item.count_type))
            fields.append((item.name, order + item.type, (length,)))
        else:
            fields.append((item.name, order + item.type))
    return np.dtype(fields), lengths


def _length(content: memoryview, at: int, kind: str, element: Element, row: int) -> int:
    dtype = np.dtype(kind)
    if at + dtype.itemsize > len(content):
        raise _cut(element, row, at)
    length = int(np.frombuffer(content, dtype, 1, at)[0])
    if length < 0:
        raise MalformedFileError(f"byte {at}: a list of length {length}")
    if length > len(content) - at:
        raise TruncatedFileError(f"byte {at}: a list of {length} numbers, the file ends before")
    return length


def _agreeing(rows: NDArray[np.void], lengths: dict[str, int]) -> int:
    """Number of leading rows whose lists have these lengths."""
    agree = np.ones(len(rows), bool)
    for name, length in lengths.items():
        agree &= rows[name] == length
    return len(rows) if agree.all() else int(np.argmin(agree))


def _cut(element: Element, row: int, offset: int) -> TruncatedFileError:
    return TruncatedFileError(
        f"byte {offset}: the file ends after {row} of {element.count} rows "
        f"of element {element.name[:40]!r}"
    )
