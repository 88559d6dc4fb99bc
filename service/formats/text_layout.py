"""The layout of delimited text, and how names of columns give it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

from service.formats.column_names import find_further, find_normals
from service.formats.numerals import is_number, is_value
from service.formats.survey_axes import with_east_first
from service.formats.text_header import (
    DELIMITERS,
    Header,
    Names,
    split_fields,
    without_empty_end,
)


@dataclass(frozen=True, slots=True)
class TextLayout:
    """Where the rows of numbers begin, and which columns are read."""

    first_row: int
    """Index of the first line of data."""
    delimiter: str | None
    """Separator of the fields; None: any run of blanks."""
    xyz: tuple[int, ...] = (0, 1, 2)
    """Columns of the coordinates."""
    normals: tuple[int, ...] | None = None
    """Columns of the normal, if they are named."""
    others: dict[str, int] = field(default_factory=dict)
    """Other named columns of numbers."""
    count: int | None = None
    """Number of rows announced in a line of its own."""
    decimal_comma: bool = False
    """Whether commas are decimal points."""
    is_mixed: bool = False
    """Whether any run of delimiters separates the fields."""
    is_open: bool = False
    """Whether the last column is a list, so that rows differ in length."""
    warnings: tuple[str, ...] = ()
    """How the text was interpreted."""


def named_layout(header: Header, row: str, index: int) -> TextLayout | None:
    """Return columns by name, if the header has x, y, z and a name for each field."""
    for delimiter in DELIMITERS:
        fields = split_fields(row, delimiter)
        for names in header.candidates(delimiter):
            if names.xyz is None or not _fit(names.items, fields, is_open=header.is_open):
                continue
            if all(is_value(fields[i]) for i in names.xyz):
                xyz, warnings = with_east_first(names.items, names.xyz, fields)
                return TextLayout(
                    index,
                    delimiter,
                    xyz,
                    find_normals(names.items),
                    _others(names, fields),
                    is_open=header.is_open,
                    warnings=_warn_of_further(names) + warnings,
                )
    return None


def _warn_of_further(names: Names) -> tuple[str, ...]:
    """Tell which coordinates are read where a header names more of them."""
    further = find_further(names.items, names.xyz or ())
    if not further:
        return ()
    listed = ", ".join(names.items[place].strip() for place in names.xyz or ())
    return (f"the columns {listed!r} are read, and not {', '.join(further)!r}",)


def shifted_layout(
    header: Header, delimiter: str | None, fields: list[str], index: int
) -> TextLayout | None:
    """Return columns by name, if the first has none, as those of row names that R writes."""
    for names in header.candidates(delimiter):
        if names.xyz is None or len(names.items) + 1 != len(fields) or header.is_open:
            continue
        normals = find_normals(names.items)
        xyz, warnings = with_east_first(names.items, names.xyz, fields[1:])
        return TextLayout(
            index,
            delimiter,
            tuple(place + 1 for place in xyz),
            normals and tuple(place + 1 for place in normals),
            {name: place + 1 for name, place in _others(names, fields[1:]).items()},
            warnings=("column 1 has no name and is taken for names of the rows", *warnings),
        )
    return None


def _fit(names: Sequence[str], fields: Sequence[str], *, is_open: bool) -> bool:
    """Whether there is a name for each field, without empty ones at the end of either."""
    if is_open:
        return len(fields) >= len(names) - 1
    return len(without_empty_end(names)) == len(without_empty_end(fields)) or (
        len(names) == len(fields)
    )


def _others(names: Names, fields: Sequence[str]) -> dict[str, int]:
    bare = [name.strip().rstrip(",;").strip("\"'") for name in names.items]
    repeated = {name for name, count in Counter(bare).items() if count > 1}
    return {
        name: place
        for place, (name, value) in enumerate(zip(bare, fields, strict=False))
        if name and name not in repeated and place not in (names.xyz or ()) and is_number(value)
    }
