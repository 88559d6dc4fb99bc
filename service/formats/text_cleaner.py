"""Lines of numbers in unusual forms, rewritten plainly."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from service.formats.errors import MalformedFileError
from service.formats.numerals import HASH_WORD, is_missing, is_number, unquote

COMMENT = re.compile(rf"(?<!\.)(?!{HASH_WORD})#")
"""Beginning of a comment; not the sign in 1.#QNAN, as Windows writes NaN, #N/A and colours."""
_TO_BLANKS = str.maketrans(",;|\t", "    ")
_END_OF_FILE = "\x1a"
"""Last character of texts of DOS."""


@dataclass(frozen=True, slots=True)
class Dialect:
    """How numbers are separated and written."""

    delimiter: str | None = None
    """Separator of the fields; None: any run of blanks."""
    keyword: str = ""
    """First word, column 0, of the lines to read; empty: all lines are read."""
    decimal_comma: bool = False
    """Whether commas are decimal points."""
    is_mixed: bool = False
    """Whether any run of commas, semicolons, bars and blanks separates the fields."""
    has_counts: bool = False
    """Whether a line of one whole number announces the rows that follow, as in PTS."""
    width: int = 0
    """Fields that a row has at most, where more of them hide which is which; 0: unbounded."""


PLAIN = Dialect()
"""Numbers between blanks."""


@dataclass(slots=True)
class TableCleaner:
    """Rewrites the wanted columns of lines whose meaning is clear although they are no numbers.

    Quotes are removed, missing values become NaN, decimal commas become points where commas do not
    separate the fields, and lines of counts are collected.
    """

    dialect: Dialect
    columns: Sequence[int]
    counts: list[int] = field(default_factory=list)
    """Rows announced by lines of one whole number."""
    headers: frozenset[str] = frozenset()
    """Lines before the data; where they are repeated among the rows they are skipped."""
    repeated_headers: int = 0
    """Lines skipped as repetitions."""
    missing_rows: int = 0
    """Rows without any value."""
    has_points: bool = False
    """Whether a number has a decimal point."""
    has_commas: bool = False
    """Whether a number has a decimal comma."""

    def clean(self, lines: Iterable[str]) -> Iterator[str]:
        """Yield the wanted columns of each line, separated by commas.

        Raises
        ------
        MalformedFileError
            Some numbers have decimal points, and some have commas.
        """
        for line in lines:
            if self.headers and line.strip() in self.headers:
                self.repeated_headers += 1
                continue
            text = unquote(COMMENT.split(line, maxsplit=1)[0].strip())
            if text in ("", _END_OF_FILE):
                continue
            if self.dialect.has_counts and text.isdecimal() and len(text) < 19:
                self.counts.append(int(text))
                continue
            fields = text.split(self.dialect.delimiter)
            if self._are_shifted(fields):
                yield "too many fields"
                continue
            if len(fields) <= max(self.columns) or "\r" in text:
                yield "too few fields"
                continue
            yield ",".join(self._clean_fields([fields[i].strip() for i in self.columns]))
            if self.has_points and self.has_commas:
                raise MalformedFileError(
                    f"{text[:60]!r}: some numbers have decimal points, and some have commas; "
                    "write all in the same way"
                )

    def _are_shifted(self, fields: Sequence[str]) -> bool:
        """Whether there are more fields than places; words at the end of a line do no harm."""
        width, delimiter = self.dialect.width, self.dialect.delimiter
        if not width or len(fields) - (not fields[-1]) <= width:
            return False
        return delimiter is not None or is_number(fields[-1])

    def _clean_fields(self, fields: list[str]) -> list[str]:
        if all(is_missing(item) for item in fields):
            self.missing_rows += 1
            return ["nan"] * len(fields)
        cleaned = ["nan" if item and is_missing(item) else item for item in fields]
        self.has_points |= any("." in item for item in cleaned)
        if not any("," in item for item in cleaned):
            return cleaned
        self.has_commas = True
        return [item.replace(",", ".") for item in cleaned]

    def warnings(self) -> tuple[str, ...]:
        """Describe what was rewritten."""
        found = []
        if self.has_commas:
            found.append("commas are read as decimal points")
        if self.repeated_headers:
            found.append(f"{self.repeated_headers} lines that repeat the header are skipped")
        if self.missing_rows:
            found.append(f"{self.missing_rows} rows without values are read as NaN")
        return tuple(found)


def normalize_lines(lines: Iterable[str], dialect: Dialect) -> Iterable[str]:
    """Yield the lines to read, with decimal points."""
    if dialect.keyword:
        starts = (f"{dialect.keyword} ", f"{dialect.keyword}\t")
        lines = (line for line in lines if line.lstrip(" \t").startswith(starts))
    if dialect.is_mixed:
        lines = (unify_delimiters(line) for line in lines)
    if dialect.decimal_comma:
        lines = (line.replace(",", ".") for line in lines)
    return lines


def unify_delimiters(line: str) -> str:
    """Return the line with blanks in place of other delimiters."""
    return line.translate(_TO_BLANKS)
