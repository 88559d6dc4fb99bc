"""The registry of readable formats, in the order in which their sniffers are tried."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from service.formats import (
    archives,
    colmap,
    draco,
    e57,
    hdf5,
    kitti,
    las,
    lvx,
    matlab,
    mesh,
    npy,
    pcd,
    ply,
    ptx,
    splat,
    spz,
    vtk,
    xyz,
)
from service.formats.decoded_cloud import DecodedCloud
from service.formats.mesh import gltf, off, stl
from service.formats.mesh import text as mesh_text
from service.formats.vtk import xml as vtk_xml

ReadChoice = Literal["scan", "faces", "attributes", "weights", "columns", "array"]
"""Keyword arguments of `read_points` that only some formats know."""


def _never(_: Any) -> bool:
    return False


@dataclass(frozen=True, slots=True)
class Format:
    """A file format: how it is recognised and read."""

    name: str
    """Name in requests and results."""
    title: str
    """One line for users: the dialects that are read."""
    extensions: tuple[str, ...]
    """Usual file extensions; for information only."""
    sniff: Callable[[bytes], bool] | None
    """Whether the first bytes of a file match; None: read only if declared."""
    read: Callable[..., DecodedCloud] | None
    """Takes the path, the limits, and the choices as keywords; None: always an archive."""
    choices: tuple[ReadChoice, ...] = ()
    """Keyword arguments that `read` takes."""
    is_archive: Callable[[Path], bool] = _never
    """Whether a file is an archive around another cloud file, which is read instead."""
    read_pieces: Callable[..., Iterator[DecodedCloud]] | None = None
    """As `read`, but yields consecutive parts of bounded size; None: files are read whole."""


def _starts_with(*magics: bytes) -> Callable[[bytes], bool]:
    return lambda head: head.startswith(magics)


FORMATS = (
    Format(
        "ply",
        "Stanford PLY: ASCII, binary of both byte orders; the vertices, or the surface of a mesh",
        (".ply",),
        ply.sniff,
        ply.read,
        ("faces", "attributes"),
        read_pieces=ply.read_pieces,
    ),
    Format(
        "pcd",
        "Point Cloud Library: ASCII, binary, binary_compressed",
        (".pcd",),
        pcd.sniff,
        pcd.read,
        ("attributes",),
        read_pieces=pcd.read_pieces,
    ),
    Format(
        "las",
        "ASPRS LAS 1.0 to 1.5 and LAZ, scale and offset in float64",
        (".las", ".laz"),
        _starts_with(las.MAGIC),
        las.read,
        ("attributes",),
        read_pieces=las.read_pieces,
    ),
    Format(
        "e57",
        "ASTM E57: one scan, or all merged, with the places of their scanners",
        (".e57",),
        _starts_with(e57.MAGIC),
        e57.read,
        ("scan", "attributes"),
        read_pieces=e57.read_pieces,
    ),
    Format(
        "ptx",
        "Leica PTX: one scan, or all merged, with the places of their scanners",
        (".ptx",),
        ptx.sniff,
        ptx.read,
        ("scan", "attributes"),
        read_pieces=ptx.read_pieces,
    ),
    Format(
        "npy",
        "NumPy array (N, 3 or more), (H, W, 3), or with fields x, y, z",
        (".npy",),
        _starts_with(npy.MAGIC),
        npy.read_npy,
        ("weights", "attributes"),
        read_pieces=npy.read_npy_pieces,
    ),
    Format(
        "hdf5",
        "HDF5, also MATLAB 7.3: the data set called points, xyz, ..., or the only one, or the one "
        "that `array` names; one of several clouds by its number",
        (".h5", ".hdf5", ".mat"),
        hdf5.sniff,
        hdf5.read,
        ("scan", "weights", "array", "attributes"),
        read_pieces=hdf5.read_pieces,
    ),
    Format(
        "matlab",
        "MATLAB 5 to 7.2: the matrix called points, xyz, ..., or the only one, or the one that "
        "`array` names",
        (".mat",),
        matlab.sniff,
        matlab.read,
        ("weights", "array", "attributes"),
    ),
    Format(
        "vtk",
        "VTK, legacy files in ASCII or binary: the surface, or the points, of poly data and grids",
        (".vtk",),
        _starts_with(vtk.MAGIC),
        vtk.read,
        ("faces", "attributes"),
        read_pieces=vtk.read_pieces,
    ),
    Format(
        "vtp",
        "VTK in XML, text or binary, compressed by zlib, LZMA or not: as legacy files",
        (".vtp", ".vtu", ".vts"),
        vtk_xml.sniff,
        vtk_xml.read,
        ("faces", "attributes"),
    ),
    Format(
        "gltf",
        "glTF 2.0 with its data inside, compressed by Draco or not: the surface, or the vertices",
        (".glb", ".gltf"),
        gltf.sniff,
        mesh.read_gltf,
        ("faces", "attributes"),
    ),
    Format(
        "draco",
        "Draco (.drc), also within glTF: points, or the surface of a mesh",
        (".drc",),
        draco.sniff,
        draco.read,
        ("faces", "attributes"),
    ),
    Format(
        "stl",
        "STL, binary and ASCII: the surface, or the vertices",
        (".stl",),
        stl.sniff,
        stl.read,
        ("faces", "attributes"),
        read_pieces=stl.read_pieces,
    ),
    Format(
        "obj",
        "Wavefront OBJ: the surface, or the vertices",
        (".obj",),
        mesh_text.sniff_obj,
        mesh_text.read_obj,
        ("faces", "attributes"),
        read_pieces=mesh_text.read_obj_pieces,
    ),
    Format(
        "off",
        "Object File Format: the surface, or the vertices",
        (".off",),
        off.sniff,
        off.read,
        ("faces", "attributes"),
        read_pieces=off.read_pieces,
    ),
    Format(
        "zip",
        "NumPy archive (.npz): the array called points, xyz, ..., or the only one, or the one that "
        "`array` names; or one file of any format, zipped",
        (".npz", ".zip"),
        _starts_with(archives.ZIP_MAGIC),
        npy.read_npz,
        ("weights", "array", "attributes"),
        is_archive=archives.is_single_file_zip,
    ),
    Format(
        "gzip",
        "one file of any format, compressed by gzip",
        (".gz",),
        _starts_with(archives.GZIP_MAGIC),
        None,
    ),
    Format(
        "xyz",
        "text, one point a line: blanks, tabs, commas, semicolons; with header or without; PTS",
        (".xyz", ".txt", ".csv", ".pts", ".asc"),
        xyz.sniff,
        xyz.read,
        ("weights", "faces", "attributes"),
        read_pieces=xyz.read_pieces,
    ),
    Format(
        "colmap",
        "COLMAP's points3D.bin; points3D.txt is read as text",
        (".bin",),
        colmap.sniff,
        colmap.read,
        ("attributes",),
    ),
    Format(
        "spz",
        "Gaussian splats of Niantic (.spz, versions 2 and 3): their centres",
        (".spz",),
        _starts_with(spz.MAGIC),
        spz.read,
        ("attributes",),
    ),
    Format(
        "lvx2",
        "Livox recordings (LVX2): all frames, merged, in metres",
        (".lvx2",),
        _starts_with(lvx.MAGIC),
        lvx.read,
        ("attributes",),
    ),
    Format(
        "splat",
        "Gaussian splats (.splat): their centres; PLY files of splats are read as PLY",
        (".splat",),
        splat.sniff,
        splat.read,
        ("attributes",),
    ),
    Format(
        "kitti",
        "rows of float32, x, y, z, intensity, or 3 to 8 `columns`, without a header: only if "
        "declared",
        (".bin",),
        None,
        kitti.read,
        ("columns", "attributes"),
        read_pieces=kitti.read_pieces,
    ),
)
