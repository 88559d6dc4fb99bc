"""What can be wrong with a cloud file; every message names the byte or the line.

CloudFileError
├── UnknownFormatError      the content is of no format that is read here
├── MalformedFileError      the content breaks the rules of its format
│   └── TruncatedFileError  the file ends before the data that it announces
├── UnsupportedFileError    a legal file of a kind that is not read here
├── MissingAttributeError   no attribute of that name holds one number for each point
└── FileLimitError          a size, count or length above its limit
"""

from __future__ import annotations

from collections.abc import Iterable

_MOST_NAMED = 40


class CloudFileError(ValueError):
    """Root of everything that reading a cloud file raises on purpose."""


class UnknownFormatError(CloudFileError):
    """The content is of no format that is read here."""


class MalformedFileError(CloudFileError):
    """The content breaks the rules of its format."""


class TruncatedFileError(MalformedFileError):
    """The file ends before the data that it announces."""


class UnsupportedFileError(CloudFileError):
    """A legal file of a kind that is not read here."""


class MissingAttributeError(CloudFileError):
    """No attribute of this name holds one number for each point."""


class FileLimitError(CloudFileError):
    """A size, count or length is above its limit."""


def missing_attribute(name: str, known: Iterable[str]) -> MissingAttributeError:
    """Say which attributes there are instead."""
    names = [repr(item[:40]) for item in known]
    there = ", ".join(names[:_MOST_NAMED]) + (", ..." if len(names) > _MOST_NAMED else "")
    return MissingAttributeError(
        f"no attribute {name[:40]!r} with one number for each point; there are {there or 'none'}"
    )
