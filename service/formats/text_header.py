"""A line of text before the rows of numbers, which may name the columns."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from service.formats.column_names import find_xyz
from service.formats.numerals import QUOTED, is_number

DELIMITERS = (";", "\t", ",", "|", None)
"""Delimiters in the order in which they are tried; None: any run of blanks."""
COMMENTS = ("#", "//", "%", "!", "*")
_UNIT = re.compile(r"[ \t]?[\[({<](?![xyzXYZ][\])])[^\[\](){}<>]{0,20}[\])}>]")
"""Unit behind a name, which is none of the words of a header."""
_LEAD = re.compile(
    r"(?:fields|columns|format|names|header)\b[ \t]*[:=]?[ \t]+|[a-z][\w ]{3,30}:[ \t]+",
    re.IGNORECASE,
)
"""What stands in a comment before the names: "Format: x y z"."""
_NUMBERING = re.compile(r"(?<!\w)\d{1,3}[:=](?=[A-Za-z])")
"""Numbers of the columns before their names: "1:x 2:y 3:z"."""
_MAX_COLUMNS = 1000
"""Columns of a table beyond which a line of text is no line of names."""


@dataclass(frozen=True, slots=True)
class Names:
    """Names of columns, and which of them are the coordinates."""

    items: list[str]
    xyz: tuple[int, ...] | None

    @classmethod
    def of(cls, items: list[str], *, may_be_prose: bool) -> Names:
        """Find the coordinates; prose with numbers, as "min x y z: 1 2 3", has none."""
        if len(items) > _MAX_COLUMNS or (may_be_prose and any(map(is_number, items))):
            return cls(items, None)
        return cls(items, find_xyz(items))


@dataclass(frozen=True, slots=True)
class Header:
    """A line of text before the data."""

    number: int  # from 1
    names: dict[str | None, Names]  # by the delimiter that separates them
    words: Names  # separated by any delimiter
    is_comment: bool
    is_open: bool  # whether the last column is a list, so that rows differ in length

    @classmethod
    def parse(cls, number: int, line: str) -> Header:
        """Split the line of this number, from 1, by each delimiter."""
        text = _hide_quoted_delimiters(line.lstrip("#/%!* \t"))
        is_comment = line.startswith(COMMENTS)
        if is_comment:
            text = _NUMBERING.sub("", text[lead.end() :] if (lead := _LEAD.match(text)) else text)
        bare = _UNIT.sub("", text)
        listed = next((word for word in text.split() if word.endswith("[]")), None)
        if listed is not None:
            text = text[: text.index(listed) + len(listed)]
            bare = text
        names = {
            delimiter: Names.of(
                split_fields(text if delimiter else bare, delimiter), may_be_prose=is_comment
            )
            for delimiter in DELIMITERS
        }
        bare_words = bare.replace(";", " ").replace(",", " ").split()
        words = Names.of(bare_words, may_be_prose=is_comment)
        return cls(number, names, words, is_comment, listed is not None)

    def candidates(self, delimiter: str | None) -> tuple[Names, Names]:
        """Return the names as the delimiter of the data separates them, and by any delimiter."""
        return self.names[delimiter], self.words

    def with_xyz(self) -> Names | None:
        """Return the first names with x, y, z among them."""
        return next((names for names in [*self.names.values(), self.words] if names.xyz), None)


def split_fields(line: str, delimiter: str | None) -> list[str]:
    """Return the fields of a line."""
    return line.strip().split(delimiter)


def without_empty_end(fields: Sequence[str]) -> list[str]:
    """Return the fields without one empty field at the end, as a trailing delimiter leaves it."""
    return list(fields[:-1] if len(fields) > 1 and not fields[-1].strip() else fields)


def _hide_quoted_delimiters(header: str) -> str:
    """Replace delimiters other than blanks within quoted names."""
    return QUOTED.sub(lambda found: re.sub(r"[,;|\t]", "_", found[0]), header)
