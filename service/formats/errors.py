"""Errors of reading and writing cloud files.

CloudFileError
├── UnknownFormatError      the content matches none of the formats
├── MalformedFileError      the content breaks the rules of its format
│   └── TruncatedFileError  the file ends before the data that it announces
├── UnsupportedFileError    a legal file of a kind that is not read
├── MissingAttributeError   no attribute of that name holds one number for each point
├── FileLimitError          a size, count or length above its limit
│   └── TooManyPointsError  more points than the memory allowed holds
└── MissingLibraryError     the library that decodes this format is not installed

Each message gives the place (byte, line or element) where it is known.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

_MAX_NAMES = 40
"""Attribute names listed in an error message."""
_PATH = re.compile(r"(?<![\w/\\])(?:[A-Za-z]:|\.\.?)?[/\\][^\s'\")]+")
_MAX_REASON = 200
"""Characters kept of the message of a library."""


class CloudFileError(ValueError):
    """Base class of all errors about a cloud file."""


class UnknownFormatError(CloudFileError):
    """The content matches none of the formats."""


class MalformedFileError(CloudFileError):
    """The content breaks the rules of its format."""


class TruncatedFileError(MalformedFileError):
    """The file ends before the data that it announces."""


class UnsupportedFileError(CloudFileError):
    """A legal file of a kind that is not read."""


class MissingAttributeError(CloudFileError):
    """No attribute of this name holds one number for each point."""


class FileLimitError(CloudFileError):
    """A size, count or length is above its limit."""


class TooManyPointsError(FileLimitError):
    """The file has more points than the memory allowed holds."""


class MissingLibraryError(CloudFileError):
    """The library that decodes this format is not installed."""


def missing_attribute(name: str, known: Iterable[str]) -> MissingAttributeError:
    """Make the error for an unknown attribute; its message lists the known ones."""
    names = [repr(item[:40]) for item in known]
    listed = ", ".join(names[:_MAX_NAMES]) + (", ..." if len(names) > _MAX_NAMES else "")
    return MissingAttributeError(
        f"no attribute {name[:40]!r} with one number for each point; "
        f"the attributes of this file: {listed or 'none'}"
    )


def short_reason(error: BaseException) -> str:
    """Return the first line of an exception's message, shortened, or the name of its class.

    Words that look like a path are left out: a caller must not learn where files lie.
    """
    lines = str(error).splitlines()
    if not lines:
        return type(error).__name__
    if isinstance(error, OSError) and error.strerror is not None:
        return error.strerror  # the message names the file
    return _PATH.sub("(path)", lines[0])[:_MAX_REASON]
