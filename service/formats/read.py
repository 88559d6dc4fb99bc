"""Detection of a file's format, and decoding of its points."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import chain
from pathlib import Path

from service.formats import las
from service.formats.archives import expand_archive
from service.formats.decoded_cloud import DecodedCloud, ReadLimits
from service.formats.degrees import refuse_degrees
from service.formats.errors import (
    CloudFileError,
    MalformedFileError,
    TooManyPointsError,
    TruncatedFileError,
    UnknownFormatError,
    UnsupportedFileError,
    missing_attribute,
)
from service.formats.foreign import foreign_format
from service.formats.foreign_guesses import guess_foreign
from service.formats.format import Format, ReadChoice
from service.formats.kitti import are_float_rows
from service.formats.las_metadata import LasRecord
from service.formats.numerals import significant_line
from service.formats.registry import FORMATS
from service.formats.text_encoding import rewrite_text, to_plain_head
from service.formats.thinning import thin_pieces

SNIFFED_BYTES = 4096
"""Bytes at the start of a file that decide its format."""
_MAX_COMMENT_BYTES = 1 << 16
"""Bytes read beyond a head of comments alone."""
_FLOAT_ROWS = (
    "; it looks like rows of float32: declare the format 'kitti', and 'columns' unless they are "
    "x, y, z, intensity"
)
EXCLUSIVE_CHOICES: tuple[ReadChoice, ...] = ("scan", "columns", "array")
"""Choices that are an error for a format without them."""
_MAYBE_DEGREES = ("las", "laz", "xyz")
"""Formats of surveys, which may hold longitude and latitude."""
_READ_IN_PIECES = f"files of {', '.join(each.name for each in FORMATS if each.read_pieces)}"
ReadChoices = dict[str, int | str | None]
_UNLIMITED = 1 << 62
"""Points of a file that is read in pieces."""


def sniff(head: bytes) -> str | None:
    """Return the name of the format of a file by its first 4096 bytes; None if unknown."""
    format = _match(to_plain_head(head[:SNIFFED_BYTES]))
    return format.name if format else None


def sniff_file(path: Path) -> str:
    """Return the name of the format of a file by its first bytes; nothing is decoded.

    Raises
    ------
    UnknownFormatError
        The content matches none of the formats.
    """
    return _detect(path).name


def read_points(
    path: str | Path,
    limits: ReadLimits | None = None,
    *,
    format: str | None = None,
    scan: int | None = None,
    weights: str | None = None,
    columns: int | None = None,
    array: str | None = None,
    attributes: bool = False,
    faces: bool = False,
) -> DecodedCloud:
    """Decode a cloud file; one with more points than the limit is thinned while it is read.

    Of meshes these are the vertices; `read_surface` samples them.

    Parameters
    ----------
    path
        The file; its name is not used.
    limits
        Bounds checked before memory is allocated; None for the defaults.
    format
        Name of the format, one of FORMATS; None: by content.
    scan
        Index, from 0, of one scan of an E57 or PTX file; None merges all. Or of one of the clouds
        in a data set of HDF5.
    weights
        Name of the attribute that holds the weight of each point: of PLY, PCD, LAS and LAZ, of
        text with named columns, a field of an NPY, or an array or field of an NPZ.
    columns
        Number of columns of the format "kitti", 3 to 8; None: x, y, z, intensity.
    array
        Name of the array of points in an HDF5, MATLAB or NPZ file, with its folder or without.
    attributes
        Keep the other columns, the faces of meshes, and what LAS says beside its points; only of
        files that are not thinned.
    faces
        Keep the faces of meshes.

    Returns
    -------
    DecodedCloud
        The points, in the unit and frame of the file.

    Raises
    ------
    CloudFileError
        The file cannot be read as a cloud; the message names the byte or line.
    MissingAttributeError
        The file has no attribute `weights`; the message lists those it has.

    Examples
    --------
    >>> from service.formats import read_points
    >>> cloud = read_points("scan.ply")  # doctest: +SKIP
    >>> cloud.points.shape  # doctest: +SKIP
    (14879, 3)
    """
    pieces = read_pieces(
        path,
        limits,
        format=format,
        scan=scan,
        weights=weights,
        columns=columns,
        array=array,
        attributes=attributes,
        faces=faces or attributes,
    )
    max_points = (limits or ReadLimits()).max_points
    cloud = next(pieces)
    second = next(pieces, None)
    if second is not None or len(cloud.points) > max_points:
        parts = chain((cloud,), () if second is None else (second,), pieces)
        cloud = thin_pieces(parts, max_points, weights)
    if cloud.format in _MAYBE_DEGREES and not cloud.crs:
        refuse_degrees(cloud.points)
    if weights is None:
        return cloud
    cloud = _take_weights(cloud, weights)
    return cloud if attributes else replace(cloud, attributes={}, las=None)


def read_pieces(
    path: str | Path,
    limits: ReadLimits | None = None,
    *,
    weights: str | None = None,
    attributes: bool = False,
    format: str | None = None,
    **choices: int | str | None,
) -> Iterator[DecodedCloud]:
    """Decode a cloud file in consecutive pieces: one, unless it has more points than the limit.

    Parameters
    ----------
    path, limits, weights, attributes, format, choices
        As for `read_points`; the column of the weights is among the attributes.

    Yields
    ------
    DecodedCloud
        At least one; of several, some may have no points, but warnings.

    Raises
    ------
    CloudFileError
        The file cannot be read as a cloud; the message names the byte or line.
    """
    path = Path(path)
    if path.stat().st_size == 0:
        raise TruncatedFileError("the file is empty")
    chosen: ReadChoices = {
        "scan": None,
        "faces": attributes,
        "columns": None,
        "array": None,
        "attributes": attributes,
        "weights": weights,
    }
    chosen |= choices
    yield from _read_text_or_bytes(path, limits or ReadLimits(), format, chosen)


def _take_weights(cloud: DecodedCloud, weights: str | None) -> DecodedCloud:
    if weights is None:
        return cloud
    if weights not in cloud.attributes:
        raise missing_attribute(weights, cloud.attributes)
    return replace(cloud, weights=cloud.attributes[weights])


def read_crs(path: Path, limits: ReadLimits | None = None) -> tuple[LasRecord, ...]:
    """Read the records of the coordinate system of a LAS or LAZ file; none of other formats.

    Raises
    ------
    CloudFileError
        The file is damaged.
    """
    limits = limits or ReadLimits()
    format = _detect(path)
    if format.read is None or format.is_archive(path):
        with expand_archive(path, limits) as inner:
            return las.read_crs(inner, limits) if _detect(inner).read is las.read else ()
    return las.read_crs(path, limits) if format.read is las.read else ()


def _read_text_or_bytes(
    path: Path, limits: ReadLimits, format: str | None, choices: ReadChoices
) -> Iterator[DecodedCloud]:
    """Read a file, or what its text is in UTF-8 with usual line ends."""
    if format is not None and _by_name(format).sniff is None:
        yield from _read(_by_name(format), path, limits, choices)
        return
    with rewrite_text(path, limits) as (plain, warnings):
        chosen = _choose(plain, format, choices["columns"])
        yield from _add_warnings(_read(chosen, plain, limits, choices), warnings)


def _read(
    format: Format, path: Path, limits: ReadLimits, choices: ReadChoices
) -> Iterator[DecodedCloud]:
    if format.read is None or format.is_archive(path):
        yield from _read_archive(path, limits, choices)
        return
    for name in EXCLUSIVE_CHOICES:
        if choices[name] is not None and name not in format.choices:
            raise MalformedFileError(
                f"{name} is set, but the file is of format {format.name}, which has no {name}"
            )
    chosen = {name: choices[name] for name in format.choices}
    if choices["weights"] is not None and "weights" not in format.choices:
        chosen["attributes"] = True
    try:
        yield format.read(path, limits, **chosen)
    except TooManyPointsError as error:
        if format.read_pieces is None:
            raise TooManyPointsError(
                f"read as {format.name}: {error}; {_READ_IN_PIECES} may be larger: they are "
                "thinned while they are read"
            ) from None
    except CloudFileError as error:
        raise _name_format(error, format) from None
    else:
        return
    try:
        yield from format.read_pieces(path, replace(limits, max_points=_UNLIMITED), **chosen)
    except CloudFileError as error:
        raise _name_format(error, format) from None


def _name_format(error: CloudFileError, format: Format) -> CloudFileError:
    return type(error)(f"read as {format.name}: {error}")


def _read_archive(path: Path, limits: ReadLimits, choices: ReadChoices) -> Iterator[DecodedCloud]:
    with expand_archive(path, limits) as inner:
        if inner.stat().st_size == 0:
            raise TruncatedFileError("the file in the archive is empty")
        with rewrite_text(inner, limits) as (plain, warnings):
            inside = _detect(plain)
            if inside.read is None or inside.is_archive(plain):
                raise UnsupportedFileError(
                    "the archive holds another archive; expected one cloud file"
                )
            yield from _add_warnings(_read(inside, plain, limits, choices), warnings)


def _add_warnings(
    pieces: Iterator[DecodedCloud], warnings: tuple[str, ...]
) -> Iterator[DecodedCloud]:
    for cloud in pieces:
        yield replace(cloud, warnings=warnings + cloud.warnings)


def _choose(path: Path, format: str | None, columns: int | str | None) -> Format:
    """Return the declared format, or the detected one; rows of declared columns need neither."""
    if format is not None:
        return _by_name(format)
    try:
        return _detect(path)
    except UnknownFormatError:
        if columns is None:
            raise
        return _by_name("kitti")


def _by_name(name: str) -> Format:
    for format in FORMATS:
        if format.name == name:
            return format
    names = ", ".join(format.name for format in FORMATS)
    raise UnknownFormatError(f"no format is called {name[:40]!r}; expected one of {names}")


def _detect(path: Path) -> Format:
    with path.open("rb") as file:
        head = to_plain_head(file.read(SNIFFED_BYTES))
        if head.startswith(b"#") and not significant_line(head):
            head += file.read(_MAX_COMMENT_BYTES)
    format = _match(head)
    if format is None:
        if (foreign := foreign_format(head)) is not None:
            raise UnknownFormatError(f"the file looks like {foreign}")
        names = ", ".join(format.name for format in FORMATS)
        hint = _FLOAT_ROWS if are_float_rows(head) else ""
        if not hint and (guess := guess_foreign(head)) is not None:
            raise UnknownFormatError(f"the file looks like {guess}")
        raise UnknownFormatError(
            f"the file begins with {head[:16]!r}: none of the formats {names}{hint}"
        )
    return format


def _match(head: bytes) -> Format | None:
    if foreign_format(head) is not None:
        return None
    return next((item for item in FORMATS if item.sniff and item.sniff(head)), None)
