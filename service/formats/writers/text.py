"""Writer of text: one point a line, each number with all its digits."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.formats.writers.outgoing import Outgoing

_FORBIDDEN = re.compile(r"[\s\x00-\x1f\x7f,;\"'#]")
_BLOCK_ROWS = 100_000
"""Rows that are turned into text at once, to bound the memory."""


def write(path: Path, cloud: Outgoing, *, delimiter: str, mark: str) -> None:
    """Write the coordinates and attributes, under a line of names that begins with `mark`.

    Without attributes and mark, in XYZ, there is no line of names: readers expect three numbers.
    """
    cloud.drop_faces()
    cloud.rename(_FORBIDDEN)
    columns = [*cloud.points.T, *cloud.columns.values()]
    with path.open("w", encoding="utf8", newline="\n") as file:
        if cloud.columns or not mark:
            file.write(mark + delimiter.join(["x", "y", "z", *cloud.columns]) + "\n")
        for start in range(0, len(cloud.points), _BLOCK_ROWS):
            words = [_to_words(column[start : start + _BLOCK_ROWS]) for column in columns]
            file.writelines(delimiter.join(row) + "\n" for row in zip(*words, strict=True))


def _to_words(column: NDArray[Any]) -> list[str]:
    """Return the shortest numerals that are read back as the same numbers."""
    return list(map(str, column if column.dtype == np.float32 else column.tolist()))
