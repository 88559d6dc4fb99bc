"""Writers of clouds and meshes, with the attributes that each format can hold."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import DecodedCloud
from service.formats.writers import e57, gltf, las, mesh, npy, pcd, ply, text
from service.formats.writers.outgoing import Outgoing


@dataclass(frozen=True, slots=True)
class Writer:
    """A format that is written."""

    write: Callable[[Path, Outgoing], None]
    """Writes the file, and notes what it changes or leaves out."""
    kept: str
    """What the format keeps beside the coordinates."""


_LAS_KEPT = (
    "all attributes, those that LAS does not know as extra bytes; records, coordinate system of "
    "the target, type of GPS time, scale; colours in 16 bits"
)
WRITERS: dict[str, Writer] = {
    "ply": Writer(ply.write, "all attributes of one number, faces; colours in 8 bits"),
    "pcd": Writer(pcd.write, "all attributes of one number, viewpoint; colours in 8 bits as rgb"),
    "las": Writer(partial(las.write, is_compressed=False), _LAS_KEPT),
    "laz": Writer(partial(las.write, is_compressed=True), _LAS_KEPT),
    "e57": Writer(e57.write, "all attributes, those that E57 does not know as an extension"),
    "npy": Writer(npy.write, "all attributes as they are"),
    "xyz": Writer(partial(text.write, delimiter=" ", mark="# "), "all attributes as they are"),
    "csv": Writer(partial(text.write, delimiter=",", mark=""), "all attributes as they are"),
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
    return tuple(outgoing.notes)


def write_ply(
    path: Path,
    points: NDArray[np.floating],
    attributes: Mapping[str, NDArray[np.generic]] | None = None,
) -> None:
    """Write points and (N,) attributes as a binary PLY file; coordinates keep their precision."""
    write_cloud(path, "ply", DecodedCloud(points, "ply", attributes=dict(attributes or {})))
