"""Recognition of numbers and of missing values in text, in linear time."""

from __future__ import annotations

import re

_NUMBER = re.compile(
    r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?|[+-]?(?:nan|inf|infinity)",
    re.IGNORECASE | re.ASCII,
)
"""Unambiguous, so that matching does not backtrack."""
QUOTED = re.compile(r"\"([^\"]*)\"|(?:(?<=[,;|\s])|^)'([^']*)'(?=[,;|\s]|$)")
"""Quoted words; a single quote within a word is an apostrophe."""
_ONLY_DIGITS = re.compile(r"[\d\s.,eE+-]*", re.ASCII)
_DELIMITERS = re.compile(r"[,;|\s]")
MISSING = frozenset(
    (
        *("<na>", "-", "--", "---", "nil", "missing", "undefined", "no data", "nodata"),
        *("na", "n/a", "null", "none", "-nan", "\\n", "?", "*", ".", "infinite", "∞", "-∞"),
    )
)
"""Words, in lower case, that stand for a missing number; \\n is that of MySQL, in lower case."""
_NO_NUMBER = re.compile(r"[+-]?(?:1\.#\w*|nan\(\w*\))")
"""NaN and infinity as the libraries of C write them, with any number of digits."""
_MAX_MISSING_CHARACTERS = 24
_SHEET_ERROR = re.compile(r"#(?:N/[AV]|NV|DIV/0!|[A-Z]{3,7}[!?])")
"""Errors of spreadsheets: #N/A, #DIV/0!, #WERT!, #NAME?."""
HASH_WORD = rf"{_SHEET_ERROR.pattern}|#[0-9A-Fa-f]{{6}}(?=[ \t]*[,;|])"
"""Words that begin like a comment and are none: errors of spreadsheets, and colours as #ff8000."""


def is_number(field: str) -> bool:
    """Whether the field is one number, NaN or infinity."""
    return _NUMBER.fullmatch(field.strip()) is not None


def is_missing(field: str) -> bool:
    """Whether the field is empty or a word for a missing number."""
    bare = field.strip()
    if len(bare) > _MAX_MISSING_CHARACTERS:
        return False
    word = bare.lower()
    is_special = _NO_NUMBER.fullmatch(word) or _SHEET_ERROR.fullmatch(bare)
    return not word or word in MISSING or is_special is not None


def is_value(field: str) -> bool:
    """Whether the field is a number or stands for a missing one."""
    return is_number(field) or is_missing(field)


def unquote(row: str) -> str:
    """Remove the quotes of a row; delimiters and blanks within quoted words are replaced."""
    if '"' not in row and "'" not in row:
        return row
    return QUOTED.sub(_join_words, row).replace('"', "")


def _join_words(quoted: re.Match[str]) -> str:
    text = quoted[1] or quoted[2] or ""
    return text if _ONLY_DIGITS.fullmatch(text) else _DELIMITERS.sub("_", text)


def significant_line(head: bytes) -> bytes:
    """Return the first line that is neither blank nor a comment (#), without blanks around it."""
    for line in head.split(b"\n"):
        bare = line.strip()
        if bare and not bare.startswith(b"#"):
            return bare
    return b""
