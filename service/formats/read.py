"""Which format a file is of, and its points."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from service.formats.archives import unwrapped
from service.formats.decoded_cloud import DecodedCloud, Limits
from service.formats.errors import (
    MalformedFileError,
    TruncatedFileError,
    UnknownFormatError,
    UnsupportedFileError,
    missing_attribute,
)
from service.formats.registry import FORMATS, Choice, Format

SNIFFED_BYTES = 4096
PLACES: tuple[Choice, ...] = ("scan", "surface_samples")
"""Choices that make no sense for a format without them."""
Choices = dict[Choice, int | str | None]


def sniff(head: bytes) -> str | None:
    """Name the format of a file from its first bytes (4096 do), None if it is none of ours."""
    found = _find(head[:SNIFFED_BYTES])
    return found.name if found else None


def read_points(
    path: str | Path,
    limits: Limits | None = None,
    *,
    format: str | None = None,
    scan: int | None = None,
    surface_samples: int | None = None,
    weights: str | None = None,
    attributes: bool = False,
) -> DecodedCloud:
    """Decode a cloud file; the content decides the format, unless it is declared.

    ``scan`` picks one scan, counted from 0, of a file with several, which are merged otherwise.
    ``surface_samples`` takes that many points of a mesh's surface, spread evenly by area, instead
    of its vertices. ``attributes`` keeps the other columns of PLY, PCD, LAS and LAZ. ``weights``
    names the attribute that says how much each point counts, in these formats, in text whose
    columns have names, a field of an NPY, or an array or field of an NPZ.

    Raises
    ------
    CloudFileError
        The file cannot be read as a cloud; the message names the byte or line.
    MissingAttributeError
        It has no such weights; the message names the attributes that there are.
    """
    path = Path(path)
    if path.stat().st_size == 0:
        raise TruncatedFileError("the file is empty")
    found = _sniffed(path) if format is None else _named(format)
    choices: Choices = {
        "scan": scan,
        "surface_samples": surface_samples,
        "attributes": attributes or weights is not None,
        "weights": weights,
    }
    cloud = _read(found, path, limits or Limits(), choices)
    if weights is None:
        return cloud
    if weights not in cloud.attributes:
        raise missing_attribute(weights, cloud.attributes)
    kept = cloud.attributes if attributes else {}
    return replace(cloud, weights=cloud.attributes[weights], attributes=kept)


def _read(found: Format, path: Path, limits: Limits, choices: Choices) -> DecodedCloud:
    if found.read is None or found.wraps(path):
        with unwrapped(path, limits) as inner:
            if inner.stat().st_size == 0:
                raise TruncatedFileError("the file within the archive is empty")
            inside = _sniffed(inner)
            if inside.read is None or inside.wraps(inner):
                raise UnsupportedFileError("an archive within an archive")
            return _read(inside, inner, limits, choices)
    for name, value in choices.items():
        if name in PLACES and value is not None and name not in found.choices:
            raise MalformedFileError(f"{name} is chosen, but the file is of format {found.name}")
    return found.read(path, limits, **{name: choices[name] for name in found.choices})


def _named(name: str) -> Format:
    for format in FORMATS:
        if format.name == name:
            return format
    names = ", ".join(format.name for format in FORMATS)
    raise UnknownFormatError(f"no format is called {name[:40]!r}; there are {names}")


def _sniffed(path: Path) -> Format:
    with path.open("rb") as file:
        head = file.read(SNIFFED_BYTES)
    found = _find(head)
    if found is None:
        names = ", ".join(format.name for format in FORMATS)
        raise UnknownFormatError(f"begins with {head[:16]!r}: none of the formats {names}")
    return found


def _find(head: bytes) -> Format | None:
    return next((item for item in FORMATS if item.sniff and item.sniff(head)), None)
