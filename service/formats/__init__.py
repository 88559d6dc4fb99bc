"""Readers and writers of point cloud files, chosen by content and never by file name.

Needs numpy only, and a kernel of mpe_core for large text. The libraries of single formats (laspy,
pye57, trimesh) are imported when a file of such a format is read or written.
"""

from __future__ import annotations

from service.formats.brightness import common_brightness
from service.formats.crs import warn_unlike
from service.formats.decoded_cloud import DecodedCloud, ReadLimits
from service.formats.errors import (
    CloudFileError,
    FileLimitError,
    MalformedFileError,
    MissingAttributeError,
    MissingLibraryError,
    TooManyPointsError,
    TruncatedFileError,
    UnknownFormatError,
    UnsupportedFileError,
)
from service.formats.format import Format
from service.formats.las_metadata import LasMetadata, LasRecord
from service.formats.read import read_crs, read_pieces, read_points, sniff, sniff_file
from service.formats.registry import FORMATS
from service.formats.surface import read_surface
from service.formats.writers import WRITERS, write_cloud, write_pieces, write_ply

__all__ = [
    "FORMATS",
    "WRITERS",
    "CloudFileError",
    "DecodedCloud",
    "FileLimitError",
    "Format",
    "LasMetadata",
    "LasRecord",
    "MalformedFileError",
    "MissingAttributeError",
    "MissingLibraryError",
    "ReadLimits",
    "TooManyPointsError",
    "TruncatedFileError",
    "UnknownFormatError",
    "UnsupportedFileError",
    "common_brightness",
    "read_crs",
    "read_pieces",
    "read_points",
    "read_surface",
    "sniff",
    "sniff_file",
    "warn_unlike",
    "write_cloud",
    "write_pieces",
    "write_ply",
]
