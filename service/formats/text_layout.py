"""Detection of the layout of delimited text: header, delimiter and columns."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from service.formats.column_names import are_other_quantities, find_normals
from service.formats.errors import CloudFileError, MalformedFileError
from service.formats.numerals import is_number, is_value, unquote
from service.formats.text_guesses import (
    SAMPLED_ROWS,
    Rows,
    are_labelled,
    counts_rows,
    has_decimal_commas,
    refuse_few_long_rows,
    refuse_poses,
    refuse_rows_and_columns,
    sample_rows,
)
from service.formats.text_header import (
    COMMENTS,
    DELIMITERS,
    Header,
    Names,
    split_fields,
    without_empty_end,
)
from service.formats.text_refusals import refuse_geographic, refuse_misplaced, refuse_other_names

_MIN_ROW_CHARACTERS = 5
"""Length of the shortest row or header of three columns: "1 2 3"."""
_MAX_TEXT_LINES = 200
"""Lines of text before the first row of numbers; more of them are no header."""


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
    is_open: bool = False
    """Whether the last column is a list, so that rows differ in length."""
    warnings: tuple[str, ...] = ()
    """How the text was interpreted."""


def detect_layout(lines: Sequence[str]) -> TextLayout | None:
    """Find the layout of the lines, with decimal points or else with decimal commas.

    Returns
    -------
    TextLayout | None
        None without a line of three numbers.

    Raises
    ------
    CloudFileError
        The header names other columns, or not as many as there are.
    """
    layout = _find_layout(lines, decimal_comma=False)
    if layout is not None and not any("," in line for line in lines[: layout.first_row]):
        return layout
    other = _find_decimal_commas(lines)
    if other is None or (layout is not None and layout.first_row <= other.first_row):
        return layout or _find_labelled(lines)
    return other


def _find_decimal_commas(lines: Sequence[str]) -> TextLayout | None:
    """Find the layout with decimal commas; None where commas separate or a header contradicts."""
    try:
        layout = _find_layout(lines, decimal_comma=True)
    except CloudFileError:
        return None
    if layout is None or layout.delimiter == ",":
        return None
    warnings = (*layout.warnings, "commas are read as decimal points")
    return replace(layout, decimal_comma=True, warnings=warnings)


def _find_layout(lines: Sequence[str], *, decimal_comma: bool) -> TextLayout | None:
    """Find the first line of data and the header that fits it."""
    named: Header | None = None  # the last header with x, y, z
    headers: list[Header] = []  # the last line of text, and the last comment
    skipped: list[int] = []
    count: int | None = None
    for index, raw in enumerate(lines):
        text = raw.strip()
        if not text:
            continue
        row = unquote(text)
        row = row.replace(",", ".") if decimal_comma else row
        is_short = len(row) < _MIN_ROW_CHARACTERS
        layout = _named_layout(named, row, index) if named and not is_short else None
        if layout is None and (fields := _numeric_fields(row)) is not None:
            if fields[0] and _is_numbered_header(fields[1], lines[index + 1 : index + 2]):
                headers = [Header.parse(index + 1, text)]
                skipped.append(index + 1)
                continue
            sample = sample_rows(lines[index:], fields[0])
            layout = _unnamed_layout(named, headers, fields, sample, index, count)
        if layout is not None:
            lost = [number for number in skipped if named is None or number != named.number]
            return _complete(layout, count, lost)
        if text.isdecimal() and count is None:
            count = int(text[:18])
            continue
        if not text.startswith(COMMENTS):
            skipped.append(index + 1)
            if not text.isdecimal():
                count = None  # what is not right before the rows announces something else
        if len(skipped) > _MAX_TEXT_LINES:
            return None
        if is_short:
            continue
        header = Header.parse(index + 1, text)
        named = header if header.with_xyz() else named
        headers = [item for item in headers if item.is_comment != header.is_comment] + [header]
    return None


def _complete(layout: TextLayout, count: int | None, skipped: Sequence[int]) -> TextLayout:
    warnings = layout.warnings
    if skipped:
        place = f"line {skipped[0]} to {skipped[-1]}"
        warnings = (f"{place}: skipped as a header", *warnings)
    return replace(layout, count=count, warnings=warnings)


def _named_layout(header: Header, row: str, index: int) -> TextLayout | None:
    """Return columns by name, if the header has x, y, z and a name for each field."""
    for delimiter in DELIMITERS:
        fields = split_fields(row, delimiter)
        for names in header.candidates(delimiter):
            if names.xyz is None or not _fit(names.items, fields, is_open=header.is_open):
                continue
            if all(is_value(fields[i]) for i in names.xyz):
                normals, others = find_normals(names.items), _others(names, fields)
                return TextLayout(
                    index, delimiter, names.xyz, normals, others, is_open=header.is_open
                )
    return None


def _shifted_layout(
    header: Header, delimiter: str | None, fields: list[str], index: int
) -> TextLayout | None:
    """Return columns by name, if the first has none, as those of row names that R writes."""
    for names in header.candidates(delimiter):
        if names.xyz is None or len(names.items) + 1 != len(fields) or header.is_open:
            continue
        normals = find_normals(names.items)
        return TextLayout(
            index,
            delimiter,
            tuple(place + 1 for place in names.xyz),
            normals and tuple(place + 1 for place in normals),
            {name: place + 1 for name, place in _others(names, fields[1:]).items()},
            warnings=("column 1 has no name and is taken for names of the rows",),
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
    bare = [name.strip().strip("\"'") for name in names.items]
    repeated = {name for name, count in Counter(bare).items() if count > 1}
    return {
        name: place
        for place, (name, value) in enumerate(zip(bare, fields, strict=False))
        if name and name not in repeated and place not in (names.xyz or ()) and is_number(value)
    }


def _unnamed_layout(
    named: Header | None,
    headers: Sequence[Header],
    found: tuple[str | None, list[str]],
    sample: Rows,
    index: int,
    count: int | None,
) -> TextLayout:
    """Take the first three columns, or those after one that counts, unless a header contradicts.

    Raises
    ------
    CloudFileError
        A header names other columns, or not as many as there are, or the rows are poses.
    """
    delimiter, values = found
    fields = without_empty_end(values)
    for header in headers:
        refuse_geographic(header, delimiter, fields)
        names = header.names[delimiter].items
        if names == ["", *map(str, range(len(names) - 1))] and len(names) == len(fields) > 3:
            warning = "column 1 is taken for the row index of pandas; columns 2 to 4 are read"
            return TextLayout(index, delimiter, (1, 2, 3), warnings=(warning,))
    if len(fields) == 3:
        return TextLayout(index, delimiter, warnings=_warn_of_three(headers, delimiter))
    is_counted = counts_rows(sample)
    if named is not None:
        if is_counted and (layout := _shifted_layout(named, delimiter, fields, index)):
            return layout
        refuse_misplaced(named, fields, index)
    for header in headers:
        refuse_other_names(header, delimiter, fields, index)
    if delimiter == "," and has_decimal_commas(sample):
        raise MalformedFileError(
            f"line {index + 1}: commas seem to be decimal points as well as separators; "
            "separate the fields by semicolons, or write decimal points"
        )
    refuse_poses(sample)
    refuse_rows_and_columns(sample)
    refuse_few_long_rows(sample)
    if is_counted:
        warning = f"column 1 counts the rows; columns 2, 3 and 4 of {len(fields)} are read"
        return TextLayout(index, delimiter, (1, 2, 3), warnings=(warning,))
    if count is not None:  # PTS
        return TextLayout(index, delimiter)
    warning = f"columns 1, 2 and 3 of {len(fields)} have no names and are read as x, y, z"
    return TextLayout(index, delimiter, warnings=(warning,))


def _warn_of_three(headers: Sequence[Header], delimiter: str | None) -> tuple[str, ...]:
    """Say which columns are read, where a header calls three columns otherwise.

    Raises
    ------
    MalformedFileError
        They are known to be no coordinates along axes.
    """
    for header in headers:
        for names in header.candidates(delimiter):
            items = [name.strip().strip("\"'") for name in without_empty_end(names.items)]
            if names.xyz or len(items) != 3 or any(not name or is_number(name) for name in items):
                continue
            listed = ", ".join(items)[:80]
            is_flat = [item.lower() for item in items[:2]] == ["x", "y"]
            if are_other_quantities(items) or (is_flat and are_other_quantities(items[2:])):
                raise MalformedFileError(
                    f"line {header.number}: the columns are called {listed!r}; expected the names "
                    "x, y and z: convert other coordinates"
                )
            if not header.is_comment:
                return (f"the columns called {listed!r} are read as x, y, z",)
    return ()


def _find_labelled(lines: Sequence[str]) -> TextLayout | None:
    """Find rows of a label and coordinates, after comments and at most one line of names.

    Raises
    ------
    CloudFileError
        A header calls the columns otherwise.
    """
    rows = [index for index, line in enumerate(lines) if line.strip() and line[:1] not in "#/%!*"]
    for delimiter in DELIMITERS:
        following = sample_rows([lines[index] for index in rows[1 : SAMPLED_ROWS + 1]], delimiter)
        if are_labelled(following):
            fields, first = following[0], rows[0]
            headers = [Header.parse(i + 1, lines[i].strip()) for i in range(first + 1)]
            if layout := _shifted_layout(headers[-1], delimiter, fields, rows[1]):
                return layout
            for header in headers:
                refuse_geographic(header, delimiter, fields)
                refuse_other_names(header, delimiter, fields, rows[1])
        sample = sample_rows([lines[index] for index in rows[: SAMPLED_ROWS + 1]], delimiter)
        if are_labelled(sample):
            is_counted = counts_rows([row[1:] for row in sample])
            what = "columns 1 and 2 label" if is_counted else "column 1 labels"
            xyz = (2, 3, 4) if is_counted else (1, 2, 3)
            listed = "{}, {} and {}".format(*(place + 1 for place in xyz))
            warning = f"{what} the points; columns {listed} of {len(sample[0])} are read"
            return TextLayout(rows[0], delimiter, xyz, warnings=(warning,))
    return None


def _is_numbered_header(fields: Sequence[str], following: Sequence[str]) -> bool:
    """Whether the fields are 0, 1, 2, ... over decimal numbers, as pandas writes by default."""
    if [item.strip() for item in fields] != list(map(str, range(len(fields)))):
        return False
    return any(
        "." in line and _numeric_fields(line.replace('"', "").strip()) is not None
        for line in following
    )


def _numeric_fields(row: str) -> tuple[str | None, list[str]] | None:
    """Return the delimiter and the fields, if the first three are numbers."""
    for delimiter in DELIMITERS:
        fields = row.split(delimiter)
        if len(fields) >= 3 and all(is_number(item) for item in fields[:3]):
            return delimiter, fields
    return None
