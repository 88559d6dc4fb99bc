"""Beginnings of files of well-known formats that are not read, for error messages."""

from __future__ import annotations

_EXPORT = "export it as PLY, PCD, LAS or E57"
_UNPACK = "send the file uncompressed, in gzip or zip"
_SAVE_NPY = "save the points as .npy, since pickles are never loaded"
_SAVE_HDF5 = "save the points as .npy or HDF5"
_SEND_POINTS = "send a point cloud"
_UNPROJECT = "turn each pixel's depth into a point x y z by the camera's intrinsics"
_LINES = "export its points as lines of x y z"
_SURFACE = "export its surface as STL"
_TABLE = "save the table as CSV or .npy"
_MAX_CONTROL = 9
"""Bytes below it are in no text."""
_LOOKED_AT_BYTES = 512
_Kinds = tuple[tuple[tuple[bytes, ...], str, str], ...]
_BINARY: _Kinds = (
    ((b"SQLite format 3\0",), "SQLite, also GeoPackage", _EXPORT),
    ((b"#ROSBAG V",), "ROS bag", "export its scans as PCD"),
    ((b"\x89MCAP0\r\n",), "MCAP", "export its scans as PCD"),
    ((b"\xd4\xc3\xb2\xa1", b"\xa1\xb2\xc3\xd4", b"\n\r\r\n"), "packet capture", _EXPORT),
    ((b"Kaydara FBX Binary",), "FBX", "export it as OBJ or glTF"),
    ((b"BLENDER",), "Blender", "export it as PLY, OBJ or glTF"),
    ((b"\0\0\x27\x0a",), "ESRI shapefile", _LINES),
    ((b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"), "TIFF", "convert the raster to lines of x y z"),
    ((b"v/1\x01",), "OpenEXR, an image", _UNPROJECT),
    (
        (b"\x89PNG", b"\xff\xd8\xff", b"GIF8", b"\0\0\0\x0cjP", b"\xff\x4f\xff\x51"),
        "image",
        _SEND_POINTS,
    ),
    ((b"\xabKTX", b"DDS ", b"qoif", b"8BPS", b"\0\0\1\0"), "image", _SEND_POINTS),
    ((b"%PDF",), "PDF", _SEND_POINTS),
    (
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1",),
        "Microsoft Office or SolidWorks",
        "save the sheet as CSV, the part as STL",
    ),
    ((b"AC10",), "DWG", "export its points as LAS or its surfaces as STL"),
    ((b"PXR-USDC",), "USD", "export it as glTF, OBJ or PLY"),
    ((b"DSBB", b"DSRB"), "Surfer grid", "convert it to lines of x y z"),
    ((b"3D Geometry File Format",), "Rhino", "export it as PLY, OBJ or E57"),
    ((b"V5_CFV2", b"V4CATIA"), "CATIA", _SURFACE),
    ((b"RIFF", b"OggS", b"ID3", b"fLaC", b"\x1aE\xdf\xa3"), "sound, video or WebP", _SEND_POINTS),
    (
        (b"7z\xbc\xaf", b"Rar!", b"\x28\xb5\x2f\xfd", b"\xfd7zXZ", b"BZh", b"\x04\x22\x4d\x18"),
        "archive",
        _UNPACK,
    ),
    ((b"PK\x05\x06",), "empty zip archive", "put one cloud file into it"),
    ((b"CDF\x01", b"CDF\x02", b"CDF\x05"), "NetCDF", _SAVE_HDF5),
    ((b"\x0e\x03\x13\x01",), "HDF4", _SAVE_HDF5),
    ((b"GRIB",), "GRIB, a grid of the weather", "convert it to lines of x y z"),
    ((b"pnts", b"b3dm", b"i3dm", b"cmpt"), "3D Tiles", _EXPORT),
    ((b"PAR1", b"ARROW1", b"FEA1", b"ORC", b"Obj\x01"), "Parquet, Arrow, ORC or Avro", _TABLE),
    ((b"RDX2\n", b"RDX3\n", b"X\n\0\0\0", b"root\0"), "data of R or ROOT", _TABLE),
    ((b"\xc3\x40\xf1",), "SEG-Y", _LINES),
    ((b"$FL2", b"$FL3", b"\0\1\0\0Standard "), "SPSS or Access", _TABLE),
    ((b"\x80\x02", b"\x80\x03", b"\x80\x04", b"\x80\x05"), "Python pickle", _SAVE_NPY),
    ((b"\x7fELF", b"MZ", b"\xca\xfe\xba\xbe", b"\xcf\xfa\xed\xfe"), "program", _SEND_POINTS),
)
"""Beginnings of binary files, the name of the format, and what to do."""
_TEXT: _Kinds = (
    ((b"ISO-10303-21",), "STEP", _SURFACE),
    ((b"version https://git-lfs",), "Git LFS pointer", "fetch the file with: git lfs pull"),
    ((b"#VRML", b"#X3D"), "VRML", "export it as PLY, OBJ or glTF"),
    ((b"#usda",), "USD", "export it as glTF, OBJ or PLY"),
    (
        (b"# Image list with two lines", b"# Camera list with one line"),
        "COLMAP's list of images or cameras",
        "send its points3D.bin or points3D.txt",
    ),
    ((b"# Bundle file",), "Bundler", "export its points as PLY"),
    ((b"NVM_V3",), "VisualSFM", "export its points as PLY"),
    ((b"PATCHES", b"PATCHS"), "PMVS", "send its .ply"),
    ((b"DSAA",), "Surfer grid", "convert it to lines of x y z"),
    ((b"GOCAD ",), "GOCAD", _LINES),
    ((b"$MeshFormat",), "Gmsh", "export it as PLY, STL or VTK"),
    ((b"*Heading", b"*HEADING", b"*Node", b"*NODE", b"*KEYWORD"), "Abaqus or LS-DYNA", _SURFACE),
    ((b"/PREP7", b"/COM,ANSYS", b"/BATCH"), "ANSYS", _SURFACE),
    ((b"FoamFile", b"/*--------------------------------*- C++"), "OpenFOAM", "export it as VTK"),
    ((b"VERTEX_SE", b"EDGE_SE", b"VERTEX3 ", b"EDGE3 "), "g2o, a graph of poses", _SEND_POINTS),
    ((b"MeshVersionFormatted",), "Medit", "export it as PLY, STL or VTK"),
    ((b"BEGIN BULK", b"GRID,", b"GRID  ", b"SOL "), "Nastran", _SURFACE),
    ((b"ATOM  ", b"HEADER    ", b"HETATM"), "PDB, a molecule", _SEND_POINTS),
    ((b"DBRep_DrawableShape", b"CASCADE Topology"), "Open CASCADE", _SURFACE),
    ((b"newmtl ",), "materials of an OBJ file", "send the OBJ file itself"),
    ((b"#?RADIANCE", b"#?RGBE"), "Radiance HDR, an image", _SEND_POINTS),
    ((b"NRRD000",), "NRRD, a volume", _SURFACE),
    ((b"ObjectType = ", b"NDims = "), "MetaImage, a volume", _SURFACE),
    ((b"SIMPLE  = ",), "FITS", _SAVE_HDF5),
    ((b"EXP  0 ",), "ESRI E00", _LINES),
    ((b"FAROARM", b"00NM"), "field book of a total station", _LINES),
)
"""Beginnings of text, the name of the format, and what to do."""


def foreign_beginning(head: bytes) -> str | None:
    """Describe a file that begins as those of a format that is not read; else None."""
    start = head[:_LOOKED_AT_BYTES]
    is_binary = any(byte < _MAX_CONTROL for byte in start) or not start[:4].isascii()
    for magics, name, advice in _BINARY * is_binary + _TEXT:
        if head.startswith(magics):
            return f"{name} ({head[:8]!r}), which is not read: {advice}"
    return None
