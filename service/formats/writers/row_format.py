"""Formats of a header and rows of one layout, which are written whole or in pieces."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from service.formats.writers.outgoing import Outgoing

Append = Callable[[Outgoing, int], None]
"""Writes the rows of a cloud except for so many at its end."""


def _to_bytes(rows: NDArray[Any]) -> Iterable[bytes]:
    return (rows.tobytes(),)


@dataclass(frozen=True, slots=True)
class RowFormat:
    """How a cloud becomes a header and rows."""

    encode: Callable[[Outgoing], NDArray[Any]]
    """Returns the rows, and notes what is changed or left out."""
    header: Callable[[Outgoing, NDArray[Any], int], bytes]
    """Takes an encoded cloud, its rows for their layout, and the number of rows of the file."""
    body: Callable[[NDArray[Any]], Iterable[bytes]] = _to_bytes
    """Returns the bytes of rows."""
    footer: Callable[[Outgoing], bytes] = lambda _: b""
    """Returns what follows the rows."""

    def write(self, path: Path, cloud: Outgoing) -> None:
        """Write a cloud."""
        rows = self.encode(cloud)
        with path.open("wb") as file:
            file.write(self.header(cloud, rows, len(rows)))
            file.writelines(self.body(rows))
            file.write(self.footer(cloud))

    @contextmanager
    def open(self, path: Path, model: Outgoing, count: int) -> Iterator[Append]:
        """Begin a file of `count` rows, whose columns have the ranges of the model's."""
        rows = self.encode(model)
        with path.open("wb") as file:
            file.write(self.header(model, rows, count))

            def append(cloud: Outgoing, surplus: int) -> None:
                piece = self.encode(cloud).astype(rows.dtype, copy=False)
                file.writelines(self.body(piece[: len(piece) - surplus]))

            yield append
