"""Files to points: one module a format, chosen by the content and never by the name."""

from __future__ import annotations

from service.formats.decoded_cloud import DecodedCloud, Limits
from service.formats.errors import (
    CloudFileError,
    FileLimitError,
    MalformedFileError,
    MissingAttributeError,
    TruncatedFileError,
    UnknownFormatError,
    UnsupportedFileError,
)
from service.formats.read import read_points, sniff
from service.formats.registry import FORMATS, Format
from service.formats.write import WRITERS, write_cloud, write_ply

__all__ = [
    "FORMATS",
    "WRITERS",
    "CloudFileError",
    "DecodedCloud",
    "FileLimitError",
    "Format",
    "Limits",
    "MalformedFileError",
    "MissingAttributeError",
    "TruncatedFileError",
    "UnknownFormatError",
    "UnsupportedFileError",
    "read_points",
    "sniff",
    "write_cloud",
    "write_ply",
]
