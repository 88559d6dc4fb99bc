"""The decoded cloud, and the limits checked before memory is allocated for it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from service.formats.errors import FileLimitError, TooManyPointsError, TruncatedFileError
from service.formats.las_metadata import LasMetadata, LasRecord


@dataclass(frozen=True, slots=True)
class DecodedCloud:
    """Points in the unit, frame and precision of the file; rows with NaN are kept."""

    points: NDArray[np.floating]
    """(N, 3) float32 or float64 in native byte order; integer coordinates become float64."""
    format: str
    """Name of the format that was read, as listed in FORMATS."""
    warnings: tuple[str, ...] = ()
    """What is unusual about the file, and how it was interpreted."""
    normals: NDArray[np.floating] | None = None
    """(N, 3) as stored, where the file has them; not normalised."""
    viewpoints: tuple[tuple[float, ...], ...] = ()
    """Poses of the scanners that measured the points, in their frame, where the file tells all of
    them: tx, ty, tz, qw, qx, qy, qz of each."""
    attributes: dict[str, NDArray[np.generic]] = field(default_factory=dict)
    """(N,) columns beside the coordinates by their names in the file; only if requested."""
    weights: NDArray[np.generic] | None = None
    """(N,) the attribute requested as the weight of each point."""
    faces: NDArray[np.int64] | None = None
    """(F, 3) triangles of a mesh as indices of points; only if requested."""
    las: LasMetadata | None = None
    """How a LAS file stores its points; only if attributes are requested."""
    crs: tuple[LasRecord, ...] = ()
    """Records of LAS that say in which coordinate system the points are."""
    rows: NDArray[np.int64] | None = None
    """(N,) rows of the file that are kept, where it was thinned while read; None: all are."""
    brightness: dict[str, NDArray[np.float32]] = field(default_factory=dict)
    """(N,) colour and intensity as `find_brightness` names them; only as `read_surface` reads."""
    mesh: DecodedCloud | None = None
    """The mesh whose surface the points are samples of."""

    @property
    def scanner_positions(self) -> tuple[tuple[float, float, float], ...]:
        """Positions of the scanners; none if the file does not tell, as PCD's default does not."""
        if self.format == "pcd" and self.viewpoints == (UNMOVED,):
            return ()
        return tuple((x, y, z) for x, y, z, *_ in self.viewpoints)


UNMOVED = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
"""Pose of a scanner in its own frame."""


PIECE_BYTES = 32 << 20
"""Bytes of a file that are decoded at once where it is read in pieces."""
POINT_BYTES = 320
"""Memory of a point of each of two clouds, from their files to the result of a registration
(docs/tuning.md)."""
PROCESS_BYTES = 800 << 20
"""Memory of a process that registers two clouds without points."""
_DECODING_BYTES = 8
"""Memory for a byte of a file that is decoded as a whole, a mesh in XML (docs/tuning.md)."""
_MAX_POINTS_PER_BYTE = 100
"""Points in a byte of a compressed file; real clouds have less than one."""
_MIN_DENSE_POINTS = 10_000_000
"""Points up to which that is not checked: a few bytes hold many copies of one."""
MIN_POINTS = 500_000
"""Points that are held whatever the memory; fewer than this do not show a scene."""


@dataclass(frozen=True, slots=True)
class ReadLimits:
    """Bounds that are checked before memory is allocated."""

    max_points: int = 50_000_000
    """Points of a cloud in memory; larger files are thinned while they are read."""
    max_header_bytes: int = 1 << 18
    """Bytes of a header."""
    max_header_lines: int = 2_000
    """Lines of a header."""
    max_line_bytes: int = 1 << 16
    """Bytes of a line of text."""
    max_properties: int = 256
    """Properties of a PLY element, fields of a PCD file."""
    max_expansion: int = 100
    """Ratio of expanded to compressed bytes; real clouds stay below 20."""
    min_free_disk_bytes: int = 0
    """Bytes of the disk that an expansion leaves free."""

    @property
    def max_whole_bytes(self) -> int:
        """Bytes of a file that is decoded as a whole: its decoding takes half of the memory."""
        return POINT_BYTES // 2 // _DECODING_BYTES * self.max_points

    @classmethod
    def within(cls, memory_bytes: int, *, min_free_disk_bytes: int = 0) -> Self:
        """Return the limits of a registration of two clouds in so much memory."""
        points = max(MIN_POINTS, (memory_bytes - PROCESS_BYTES) // POINT_BYTES)
        return cls(max_points=points, min_free_disk_bytes=min_free_disk_bytes)


def check_count(count: int, row_bytes: int, available: int, at: str, limits: ReadLimits) -> None:
    """Refuse an announced number of points above the limit or beyond the bytes of the file.

    Parameters
    ----------
    count
        Announced number of points.
    row_bytes
        Minimum size of a point, in bytes; 0 if unknown.
    available
        Bytes left in the file.
    at
        Place of the announcement, for messages.
    limits
        Bounds of the caller.

    Raises
    ------
    TooManyPointsError
        `count` is above ``limits.max_points``.
    TruncatedFileError
        `count` rows of `row_bytes` bytes do not fit into `available` bytes.
    """
    if count > limits.max_points:
        raise TooManyPointsError(f"{at}: {count} points; the limit is {limits.max_points}")
    if count * row_bytes > available:
        raise TruncatedFileError(
            f"{at}: {count} points need at least {count * row_bytes} bytes, "
            f"but only {available} follow; is the file complete?"
        )


def check_whole_size(path: Path, limits: ReadLimits) -> None:
    """Refuse a file that is decoded as a whole, and too large for the memory allowed.

    Raises
    ------
    FileLimitError
        The file is larger than ``limits.max_whole_bytes``.
    """
    size = path.stat().st_size
    if size > limits.max_whole_bytes:
        raise FileLimitError(
            f"{size} bytes; files of this format are decoded as a whole, for which the memory "
            f"allowed is enough up to {limits.max_whole_bytes} bytes: save it as binary PLY, which "
            "is read in pieces"
        )


def check_density(count: int, size: int, at: str, free: int = _MIN_DENSE_POINTS) -> None:
    """Refuse more than `free` compressed points that a file of `size` bytes can hardly hold.

    Raises
    ------
    TruncatedFileError
        There are more than _MAX_POINTS_PER_BYTE points in a byte.
    """
    if count > max(free, _MAX_POINTS_PER_BYTE * size):
        raise TruncatedFileError(
            f"{at}: {count} points in a file of {size} bytes; is the file complete?"
        )


def iter_ranges(count: int, row_bytes: int) -> Iterator[range]:
    """Divide `count` rows of a file into consecutive, even ranges of at most PIECE_BYTES."""
    step = max(1, PIECE_BYTES // max(1, row_bytes))
    pieces = -(-count // step)
    for number in range(pieces):
        yield range(count * number // pieces, count * (number + 1) // pieces)


def join_pieces(pieces: Iterable[DecodedCloud]) -> DecodedCloud:
    """Join the pieces of a file into one cloud; the last tells what is known of the whole file.

    The attributes are those of the first piece.
    """
    *others, last = pieces
    parts = [piece for piece in (*others, last) if len(piece.points)] or [last]
    names = [name for name in parts[0].attributes if all(name in p.attributes for p in parts)]
    normals = [piece.normals for piece in parts if piece.normals is not None]
    return replace(
        last,
        normals=np.concatenate(normals) if len(normals) == len(parts) else None,
        points=np.concatenate([piece.points for piece in parts]),
        attributes={name: np.concatenate([p.attributes[name] for p in parts]) for name in names},
    )
