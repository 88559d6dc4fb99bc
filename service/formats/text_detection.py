"""Detection of the layout of delimited text: header, delimiter and columns."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from service.formats.errors import CloudFileError, MalformedFileError
from service.formats.numerals import is_number, unquote
from service.formats.text_cleaner import unify_delimiters
from service.formats.text_guesses import SAMPLED_ROWS, sample_rows
from service.formats.text_header import COMMENTS, DELIMITERS, Header
from service.formats.text_layout import TextLayout, named_layout
from service.formats.text_refusals import refuse_stated_degrees
from service.formats.text_unnamed import find_labelled, unnamed_layout

_MIN_ROW_CHARACTERS = 5
"""Length of the shortest row or header of three columns: "1 2 3"."""
_COMMAS = "commas are read as decimal points"
_TOUCHING = re.compile(r"([^\s,;|]{1,40}),(?=([^\s,;|]{1,40}))")
"""Fields with a comma and no blank between them."""
_MAX_TEXT_LINES = 200
"""Lines of text before the first row of numbers; more of them are no header."""


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
    layout = _find_any_layout(lines)
    if layout is not None:
        row = lines[layout.first_row]
        row = unify_delimiters(row) if layout.is_mixed else row
        fields = sample_rows([row], layout.delimiter)[0]
        plane = [fields[place] for place in layout.xyz[:2]]
        refuse_stated_degrees(lines[: layout.first_row], plane)
    return layout


def _find_any_layout(lines: Sequence[str]) -> TextLayout | None:
    layout = _find_layout(lines, decimal_comma=False)
    if layout is not None and not any("," in line for line in lines[: layout.first_row + 1]):
        return layout
    other = _find_decimal_commas(lines)
    if other is None or (layout is not None and not _is_before(other, layout, lines)):
        return layout or find_labelled(lines) or _find_labelled_commas(lines) or _find_mixed(lines)
    _refuse_both_decimals(lines, other)
    return other


def _is_before(commas: TextLayout, points: TextLayout, lines: Sequence[str]) -> bool:
    """Whether decimal commas are right: they give an earlier row, or numbers in the same one."""
    if commas.first_row != points.first_row:
        return commas.first_row < points.first_row
    rows = sample_rows(lines[points.first_row :], points.delimiter)
    words = [word for row in rows for word in row if is_number(word.replace(",", "."))]
    has_points = any("." in word for word in words)
    return points.delimiter != "," and not has_points and any("," in word for word in words)


def _refuse_both_decimals(lines: Sequence[str], layout: TextLayout) -> None:
    """Refuse coordinates with decimal points as well as commas, which may part thousands.

    Raises
    ------
    MalformedFileError
        The first rows have both.
    """
    rows = sample_rows(lines[layout.first_row :], layout.delimiter)
    words = [row[place] for row in rows for place in layout.xyz if place < len(row)]
    commas = [word for word in words if "," in word]
    if commas and any("." in word for word in words):
        raise MalformedFileError(
            f"{commas[0][:40]!r}: some numbers have decimal points, and some have commas; "
            "write all in the same way"
        )


def _find_labelled_commas(lines: Sequence[str]) -> TextLayout | None:
    """Find rows of a label and coordinates with decimal commas."""
    layout = find_labelled([line.replace(",", ".") for line in lines])
    if layout is None or "," not in lines[layout.first_row]:
        return None
    _refuse_both_decimals(lines, layout)
    return replace(layout, decimal_comma=True, warnings=(*layout.warnings, _COMMAS))


def _find_mixed(lines: Sequence[str]) -> TextLayout | None:
    """Find the layout of rows such as "1.5, 2.5 3.5"; None where a comma may be decimal."""
    unified = [unify_delimiters(line) for line in lines]
    layout = _find_layout(unified, decimal_comma=False)
    if layout is None:
        return None
    rows = [line for line in lines[layout.first_row :] if line.strip()][:SAMPLED_ROWS]
    touching = [pair for row in rows for pair in _TOUCHING.findall(row)]
    widths = {len(unify_delimiters(row).split()) for row in rows}
    if len(widths) > 1 or not all("." in item for pair in touching for item in pair):
        return None
    warning = "commas, semicolons and blanks separate the fields"
    return replace(layout, is_mixed=True, warnings=(*layout.warnings, warning))


def _find_decimal_commas(lines: Sequence[str]) -> TextLayout | None:
    """Find the layout with decimal commas; None where commas separate or a header contradicts."""
    try:
        layout = _find_layout(lines, decimal_comma=True)
    except CloudFileError:
        return None
    if layout is None or layout.delimiter == ",":
        return None
    rows = sample_rows(lines[layout.first_row :], layout.delimiter)
    if any(word.endswith(",") for row in rows for word in row):
        return None
    return replace(layout, decimal_comma=True, warnings=(*layout.warnings, _COMMAS))


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
        layout = named_layout(named, row, index) if named and not is_short else None
        if layout is None and (fields := _numeric_fields(row)) is not None:
            if fields[0] and _is_numbered_header(fields[1], lines[index + 1 : index + 2]):
                headers = [Header.parse(index + 1, text)]
                skipped.append(index + 1)
                continue
            sample = sample_rows(lines[index : index + 2 * SAMPLED_ROWS], fields[0])
            if decimal_comma:
                sample = [[item.replace(",", ".") for item in row] for row in sample]
            layout = unnamed_layout(named, headers, fields, sample, index, count)
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
