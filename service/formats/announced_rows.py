"""Rows of numbers in text, as many as a header announces: of PLY, PCD and OFF."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import ReadLimits
from service.formats.text_block import CUT_WARNING, TextBlock, count_lines, ends_with_newline
from service.formats.text_cleaner import PLAIN, TableCleaner
from service.formats.text_table import iter_columns, read_columns


@dataclass(frozen=True, slots=True)
class AnnouncedRows:
    """Rows of the points, and how many rows of something else follow."""

    text: TextBlock
    """From the first row to the end of the file."""
    count: int
    after: int
    """Rows that follow."""
    cleaner: TableCleaner
    """What reads unusual lines, and knows what was unusual."""

    @classmethod
    def at(
        cls,
        path: Path,
        offset: int,
        line: int,
        columns: Sequence[int],
        count: int,
        after: int = 0,
    ) -> Self:
        """Return the rows that begin at this byte and line, of which these columns are read."""
        text = TextBlock(path, offset, path.stat().st_size, line)
        return cls(text, count, after, TableCleaner(PLAIN, columns))

    def read(self, limits: ReadLimits) -> NDArray[np.float64]:
        """Read the columns of all rows; see `read_columns`."""
        text, columns = self.text, self.cleaner.columns
        return read_columns(
            text.path,
            text.start,
            text.first_line,
            columns,
            limits,
            rows=self.count,
            cleaner=self.cleaner,
        )

    def read_pieces(self, limits: ReadLimits) -> Iterator[NDArray[np.float64]]:
        """Read the columns in consecutive pieces."""
        columns = self.cleaner.columns
        yield from iter_columns(self.text, columns, limits, rows=self.count, cleaner=self.cleaner)

    def warnings(self, limits: ReadLimits) -> tuple[str, ...]:
        """Describe what was unusual about the rows that were read, and lines beyond them."""
        found = self.cleaner.warnings()
        if beyond := self._count_beyond(limits):
            found += (f"{beyond} lines after the last announced row are ignored",)
        is_cut = self.after == 0 and not ends_with_newline(self.text.path)
        return (*found, CUT_WARNING) if is_cut else found

    def _count_beyond(self, limits: ReadLimits) -> int:
        announced = self.count + self.after
        if count_lines(self.text, limits) <= announced + 1:
            return 0
        lines = (line.strip() for line in self.text.lines())
        return max(0, sum(bool(line) and line[0] != "#" for line in lines) - announced)
