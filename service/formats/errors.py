"""What can be wrong with a cloud file; every message names the byte or the line.

CloudFileError
├── UnknownFormatError      the content is of no format that is read here
├── MalformedFileError      the content breaks the rules of its format
│   └── TruncatedFileError  the file ends before the data that it announces
├── UnsupportedFileError    a legal file of a kind that is not read here
└── FileLimitError          a size, count or length above its limit
"""


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


class FileLimitError(CloudFileError):
    """A size, count or length is above its limit."""
