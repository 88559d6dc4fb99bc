"""Writer of text: one point a line, each number with all its digits."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.formats.writers.outgoing import Outgoing, to_rows
from service.formats.writers.row_format import RowFormat

_FORBIDDEN = re.compile(r"[\s\x00-\x1f\x7f,;\"'#]")
_BLOCK_ROWS = 100_000
"""Rows that are turned into text at once, to bound the memory."""


def text_format(delimiter: str, mark: str) -> RowFormat:
    """Return the format of text whose line of names begins with `mark`.

    Without attributes and mark, in XYZ, there is no line of names: readers expect three numbers.
    """

    def header(cloud: Outgoing, _: NDArray[Any], __: int) -> bytes:
        if mark and not cloud.columns:
            return b""
        return (mark + delimiter.join(["x", "y", "z", *cloud.columns]) + "\n").encode()

    def body(rows: NDArray[Any]) -> Iterator[bytes]:
        for start in range(0, len(rows), _BLOCK_ROWS):
            block = rows[start : start + _BLOCK_ROWS]
            words = [_to_words(block[name]) for name in block.dtype.names or ()]
            lines = (delimiter.join(row) + "\n" for row in zip(*words, strict=True))
            yield "".join(lines).encode()

    return RowFormat(_encode, header, body)


def _encode(cloud: Outgoing) -> NDArray[np.void]:
    cloud.drop_faces()
    cloud.rename(_FORBIDDEN)
    return to_rows(cloud.points, cloud.columns)


def _to_words(column: NDArray[Any]) -> list[str]:
    """Return the shortest numerals that are read back as the same numbers."""
    return list(map(str, column if column.dtype == np.float32 else column.tolist()))
