"""Reader of the rows of a binary PLY element, with lists."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from service.formats.errors import MalformedFileError, TruncatedFileError
from service.formats.ply.header import PlyElement

_FIRST_RUN_ROWS = 64
"""Rows of the first run; each run may be twice as long as the one before."""


def read_rows(
    content: memoryview, offset: int, element: PlyElement, order: str, wanted: Sequence[str]
) -> tuple[NDArray[np.generic], int]:
    """Read scalar properties of all rows.

    Rows with lists have no fixed size, but most files repeat the same lengths. Rows are therefore
    read in runs: the lengths of the first row give the layout, and the run ends where a length
    differs.

    Parameters
    ----------
    content
        The whole file.
    offset
        Byte of the first row.
    element
        The element to read.
    order
        Byte order in NumPy's notation.
    wanted
        Names of the properties to return.

    Returns
    -------
    tuple[NDArray[np.generic], int]
        The properties (rows, len(wanted)), and the offset after the last row.

    Raises
    ------
    MalformedFileError
        A list has a negative length; the message names the byte.
    TruncatedFileError
        The file ends before the last row; the message names the row.
    """
    runs: list[NDArray[np.generic]] = [np.empty((0, len(wanted)), np.int8)]
    row, longest = 0, element.count if not element.has_lists else _FIRST_RUN_ROWS
    while row < element.count:
        layout, lengths = _row_layout(content, offset, element, order, row)
        fitting = (len(content) - offset) // layout.itemsize if layout.itemsize else element.count
        if fitting == 0:
            raise _truncated(element, row, offset)
        rows = np.frombuffer(content, layout, min(element.count - row, longest, fitting), offset)
        run = _count_agreeing(rows, lengths)
        if wanted:
            runs.append(np.stack([rows[name][:run] for name in wanted], axis=1))
        row, offset = row + run, offset + run * layout.itemsize
        longest = 2 * run + _FIRST_RUN_ROWS
    return np.concatenate(runs), offset


def read_lists(
    content: memoryview, offset: int, element: PlyElement, order: str, wanted: str
) -> tuple[NDArray[np.generic], NDArray[np.int64]]:
    """Read a list property of all rows, in runs as `read_rows` does.

    Returns
    -------
    tuple[NDArray[np.generic], NDArray[np.int64]]
        The numbers of all lists, one after the other, and the length of each list.
    """
    numbers: list[NDArray[np.generic]] = [np.empty(0, np.int64)]
    sizes: list[NDArray[np.int64]] = [np.empty(0, np.int64)]
    row, longest = 0, _FIRST_RUN_ROWS
    while row < element.count:
        layout, lengths = _row_layout(content, offset, element, order, row)
        fitting = (len(content) - offset) // layout.itemsize
        if fitting == 0:
            raise _truncated(element, row, offset)
        rows = np.frombuffer(content, layout, min(element.count - row, longest, fitting), offset)
        run = _count_agreeing(rows, lengths)
        lists = rows[wanted][:run]
        numbers.append(lists.ravel())
        sizes.append(np.full(run, lists.shape[1]))
        row, offset = row + run, offset + run * layout.itemsize
        longest = 2 * run + _FIRST_RUN_ROWS
    return np.concatenate(numbers), np.concatenate(sizes)


def _row_layout(
    content: memoryview, offset: int, element: PlyElement, order: str, row: int
) -> tuple[np.dtype[np.void], dict[str, int]]:
    """Return the layout of the row at the offset, and the lengths of its lists by field."""
    fields: list[tuple[str, str] | tuple[str, str, tuple[int]]] = []
    lengths: dict[str, int] = {}
    for number, item in enumerate(element.properties):
        if item.count_type:
            at = offset + np.dtype(fields).itemsize
            length = _list_length(content, at, order + item.count_type, element, row)
            lengths[f"length of {number}"] = length
            fields.append((f"length of {number}", order + item.count_type))
            fields.append((item.name, order + item.type, (length,)))
        else:
            fields.append((item.name, order + item.type))
    return np.dtype(fields), lengths


def _list_length(content: memoryview, at: int, kind: str, element: PlyElement, row: int) -> int:
    dtype = np.dtype(kind)
    if at + dtype.itemsize > len(content):
        raise _truncated(element, row, at)
    length = int(np.frombuffer(content, dtype, 1, at)[0])
    if length < 0:
        raise MalformedFileError(f"byte {at}: a list has the negative length {length}")
    if length > len(content) - at:
        raise TruncatedFileError(
            f"byte {at}: a list of {length} numbers goes beyond the end of the file"
        )
    return length


def _count_agreeing(rows: NDArray[np.void], lengths: dict[str, int]) -> int:
    """Count the leading rows whose lists have these lengths."""
    agree = np.ones(len(rows), bool)
    for name, length in lengths.items():
        agree &= rows[name] == length
    return len(rows) if agree.all() else int(np.argmin(agree))


def _truncated(element: PlyElement, row: int, offset: int) -> TruncatedFileError:
    return TruncatedFileError(
        f"byte {offset}: the file ends after {row} of {element.count} rows "
        f"of element {element.name[:40]!r}"
    )
