"""The layout of rows whose columns have no names: what the rows tell, else the first three."""

from __future__ import annotations

from collections.abc import Sequence

from service.formats.column_names import are_other_quantities
from service.formats.errors import MalformedFileError
from service.formats.numerals import is_number
from service.formats.text_guesses import (
    SAMPLED_ROWS,
    Rows,
    are_labelled,
    counts_rows,
    has_decimal_commas,
    refuse_long_rows,
    refuse_poses,
    sample_rows,
)
from service.formats.text_header import DELIMITERS, Header, without_empty_end
from service.formats.text_layout import TextLayout, shifted_layout
from service.formats.text_leading import describe_leading, find_leading
from service.formats.text_refusals import refuse_geographic, refuse_misplaced, refuse_other_names


def unnamed_layout(
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
        if is_counted and (layout := shifted_layout(named, delimiter, fields, index)):
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
    refuse_long_rows(sample)
    if count is not None and not is_counted:  # PTS
        return TextLayout(index, delimiter)
    if leading := find_leading(sample):
        return _behind(*leading, len(fields), index, delimiter)
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


def find_labelled(lines: Sequence[str]) -> TextLayout | None:
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
            if layout := shifted_layout(headers[-1], delimiter, fields, rows[1]):
                return layout
            for header in headers:
                refuse_geographic(header, delimiter, fields)
                refuse_other_names(header, delimiter, fields, rows[1])
        sample = sample_rows([lines[index] for index in rows[: SAMPLED_ROWS + 1]], delimiter)
        if are_labelled(sample):
            is_counted = counts_rows([row[1:] for row in sample])
            what = "label the points" if is_counted else "labels the points"
            return _behind(1 + is_counted, what, len(sample[0]), rows[0], delimiter)
    return None


def _behind(leading: int, what: str, width: int, index: int, delimiter: str | None) -> TextLayout:
    """Return the three columns behind the first ones, which are something else."""
    xyz = (leading, leading + 1, leading + 2)
    warning = describe_leading(leading, what, width)
    return TextLayout(index, delimiter, xyz, warnings=(warning,))
