"""Writers of clouds and meshes, with the attributes that each format can hold."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.crs import describe_crs
from service.formats.decoded_cloud import DecodedCloud
from service.formats.errors import UnsupportedFileError
from service.formats.writers import e57, gltf, las, mesh
from service.formats.writers.column_ranges import MODEL_ROWS, ColumnRanges
from service.formats.writers.npy import NPY
from service.formats.writers.outgoing import Outgoing
from service.formats.writers.pcd import PCD
from service.formats.writers.ply import PLY
from service.formats.writers.row_format import Append
from service.formats.writers.text import text_format


@dataclass(frozen=True, slots=True)
class Writer:
    """A format that is written."""

    write: Callable[[Path, Outgoing], None]
    """Writes the file, and notes what it changes or leaves out."""
    kept: str
    """What the format keeps beside the coordinates."""
    open: Callable[[Path, Outgoing, int], AbstractContextManager[Append]] | None = None
    """Begins a file that is written in pieces, by a model and the number of points; None: the
    format is written whole."""
    holds_crs: bool = False
    """Whether the coordinate system is written."""

    def notes(self, cloud: Outgoing) -> list[str]:
        """Return what was changed or left out of a cloud that is written."""
        if self.holds_crs or not cloud.crs:
            return cloud.notes
        name = describe_crs(cloud.crs) or "which has no name"
        return [*cloud.notes, f"the coordinate system, {name}, is left out: write LAS or LAZ"]


_LAS_KEPT = (
    "all attributes, those that LAS does not know as extra bytes; records, coordinate system of "
    "the target, type of GPS time, scale; colours in 16 bits"
)
_XYZ, _CSV = text_format(" ", "# "), text_format(",", "")
WRITERS: dict[str, Writer] = {
    "ply": Writer(PLY.write, "all attributes of one number, faces; colours in 8 bits", PLY.open),
    "pcd": Writer(
        PCD.write, "all attributes of one number, viewpoint; colours in 8 bits as rgb", PCD.open
    ),
    "las": Writer(
        partial(las.write, is_compressed=False),
        _LAS_KEPT,
        partial(las.open_pieces, is_compressed=False),
        holds_crs=True,
    ),
    "laz": Writer(
        partial(las.write, is_compressed=True),
        _LAS_KEPT,
        partial(las.open_pieces, is_compressed=True),
        holds_crs=True,
    ),
    "e57": Writer(
        e57.write,
        "all attributes, those that E57 does not know as an extension",
        e57.open_pieces,
    ),
    "npy": Writer(NPY.write, "all attributes as they are", NPY.open),
    "xyz": Writer(_XYZ.write, "all attributes as they are", _XYZ.open),
    "csv": Writer(_CSV.write, "all attributes as they are", _CSV.open),
    "obj": Writer(mesh.write_obj, "faces, normals; colours as fractions"),
    "stl": Writer(mesh.write_stl, "faces only, in float32; a cloud without faces is refused"),
    "glb": Writer(gltf.write, "faces, normals, colours in 8 bits, other attributes in float32"),
}
"""Writers by the name of their format, which is the extension of the file."""


def write_cloud(path: Path, format: str, cloud: DecodedCloud) -> tuple[str, ...]:
    """Write a cloud in one of the formats of WRITERS.

    Parameters
    ----------
    path
        File to write.
    format
        Key of WRITERS.
    cloud
        Points, attributes, and faces of a mesh.

    Returns
    -------
    tuple[str, ...]
        Warnings: what was changed or left out because the format cannot hold it.

    Raises
    ------
    UnsupportedFileError
        The format cannot hold the cloud at all: STL without faces.
    MissingLibraryError
        The library of the format is not installed.
    """
    outgoing = Outgoing.of(cloud)
    WRITERS[format].write(path, outgoing)
    return tuple(WRITERS[format].notes(outgoing))


def write_pieces(
    path: Path, format: str, read: Callable[[], Iterator[DecodedCloud]]
) -> tuple[str, ...]:
    """Write a cloud that comes in pieces, which are read twice: for their ranges, and to write.

    Parameters
    ----------
    path
        File to write.
    format
        Key of WRITERS.
    read
        Returns the pieces, with their attributes.

    Returns
    -------
    tuple[str, ...]
        Warnings of the pieces, and what was changed or left out.

    Raises
    ------
    UnsupportedFileError
        The format is only written whole.
    """
    if (begin := WRITERS[format].open) is None:
        names = ", ".join(name for name, writer in WRITERS.items() if writer.open)
        raise UnsupportedFileError(
            f"the cloud has too many points for the memory allowed to be written as {format}: "
            f"write one of {names}"
        )
    ranges = ColumnRanges()
    for piece in read():
        ranges.add(piece)
    model = Outgoing.of(ranges.model())
    with begin(path, model, ranges.count) as append:
        for piece in read():
            if len(piece.points):
                append(Outgoing.of(ranges.extend(piece)), MODEL_ROWS)
    notes = dict.fromkeys([*ranges.warnings, *WRITERS[format].notes(model)])
    if ranges.missing:
        notes[f"{ranges.missing} points have no finite coordinates"] = None
    return tuple(notes)


def write_ply(
    path: Path,
    points: NDArray[np.floating],
    attributes: Mapping[str, NDArray[np.generic]] | None = None,
) -> None:
    """Write points and (N,) attributes as a binary PLY file; coordinates keep their precision."""
    write_cloud(path, "ply", DecodedCloud(points, "ply", attributes=dict(attributes or {})))
