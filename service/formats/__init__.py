"""Files to points: one module a format, chosen by the content and never by the name."""

from __future__ import annotations

from service.formats.catalogue import FORMATS, Format
from service.formats.cloud import DecodedCloud, Limits
from service.formats.errors import (
    CloudFileError,
    FileLimitError,
    MalformedFileError,
    TruncatedFileError,
    UnknownFormatError,
    UnsupportedFileError,
)
from service.formats.ply import write_ply
from service.formats.reading import read_points, sniff

__all__ = [
    "FORMATS",
    "CloudFileError",
    "DecodedCloud",
    "FileLimitError",
    "Format",
    "Limits",
    "MalformedFileError",
    "TruncatedFileError",
    "UnknownFormatError",
    "UnsupportedFileError",
    "read_points",
    "sniff",
    "write_ply",
]
