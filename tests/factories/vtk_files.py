"""VTK files with cells and attributes, in the forms of their versions."""

from __future__ import annotations

import base64
import struct

import numpy as np
from numpy.typing import NDArray

from tests.factories.cloud_files import NORMALS, POINTS, text_rows

STRIP = np.arange(40)
POLYGONS = np.array([[0, 1, 2], [4, 5, 6]])
ATTRIBUTES: dict[str, NDArray[np.generic]] = {
    "my intensity": np.linspace(0, 1, 40, dtype=np.float32),
    "ids": np.arange(40) + (1 << 40),
    "RGB": np.arange(120, dtype=np.uint8).reshape(40, 3),
    "gradient": POINTS[:, ::-1],
}
_LEGACY = {"f4": "float", "i8": "vtktypeint64", "u1": "unsigned_char", "i4": "int"}
_XML = {"f4": "Float32", "i8": "Int64", "u1": "UInt8"}


def _numbers(values: NDArray[np.generic], *, binary: bool) -> bytes:
    big = np.ascontiguousarray(values, values.dtype.newbyteorder(">"))
    return (
        big.tobytes() + b"\n"
        if binary
        else " ".join(map(repr, values.ravel().tolist())).encode() + b"\n"
    )


def _lists(keyword: str, lists: list[NDArray[np.generic]], *, binary: bool, new: bool) -> bytes:
    """Lists of corners, with ends and corners apart where `new`."""
    corners = np.concatenate(lists)
    ends = np.cumsum([0, *map(len, lists)])
    if new:
        head = f"{keyword} {len(ends)} {len(corners)}\nOFFSETS vtktypeint64\n".encode()
        middle = _numbers(ends, binary=binary) + b"CONNECTIVITY vtktypeint64\n"
        return head + middle + _numbers(corners, binary=binary)
    mixed = np.concatenate([np.r_[len(item), item] for item in lists]).astype(np.int32)
    head = f"{keyword} {len(lists)} {len(mixed)}\n".encode()
    return head + _numbers(mixed, binary=binary)


def legacy_mesh(*, binary: bool, new: bool) -> bytes:
    """A strip, two polygons, and attributes as VTK writes them."""
    form = b"BINARY" if binary else b"ASCII"
    content = b"# vtk DataFile Version 5.1\nby hand\n" + form + b"\nDATASET POLYDATA\n"
    content += b"FIELD FieldData 1\nTIME 1 1 float\n" + _numbers(np.zeros(1, "f4"), binary=binary)
    content += b"POINTS 40 float\n" + _numbers(POINTS, binary=binary)
    content += b"METADATA\nINFORMATION 0\n\n"
    content += _lists("POLYGONS", list(POLYGONS), binary=binary, new=new)
    content += _lists("TRIANGLE_STRIPS", [STRIP], binary=binary, new=new)
    content += b"CELL_DATA 3\nSCALARS quality float 1\nLOOKUP_TABLE default\n"
    content += _numbers(np.ones(3, "f4"), binary=binary) + b"POINT_DATA 40\n"
    content += b"NORMALS Normals float\n" + _numbers(NORMALS, binary=binary)
    content += f"FIELD FieldData {len(ATTRIBUTES)}\n".encode()
    for name, values in ATTRIBUTES.items():
        width, kind = values.size // 40, _LEGACY[values.dtype.str[1:]]
        content += f"{name.replace(' ', '%20')} {width} 40 {kind}\n".encode()
        content += _numbers(values, binary=binary)
    return content


def xml_mesh() -> bytes:
    """The same in XML."""

    def array(name: str, values: NDArray[np.generic]) -> str:
        width = values.size // len(values)
        data = values.tobytes()
        text = base64.b64encode(struct.pack("<I", len(data)) + data).decode()
        return (
            f'<DataArray type="{_XML[values.dtype.str[1:]]}" Name="{name}" '
            f'NumberOfComponents="{width}" format="binary">{text}</DataArray>'
        )

    def cells(tag: str, corners: NDArray[np.generic], ends: list[int]) -> str:
        parts = array("connectivity", corners.ravel()) + array("offsets", np.array(ends))
        return f"<{tag}>{parts}</{tag}>"

    named = {"Normals": NORMALS} | ATTRIBUTES
    return (
        '<VTKFile type="PolyData" byte_order="LittleEndian"><PolyData><Piece><PointData>'
        + "".join(array(name, values) for name, values in named.items())
        + f"</PointData><Points>{array('Points', POINTS)}</Points>"
        + cells("Polys", POLYGONS, [3, 6])
        + cells("Strips", STRIP, [40])
        + "</Piece></PolyData></VTKFile>"
    ).encode()


def solid_grid() -> bytes:
    """A cube, and beside it a second one of two wedges."""
    points = np.stack(np.meshgrid([0, 1, 2], [0, 1], [0, 1], indexing="ij"), axis=-1).reshape(-1, 3)
    number = {tuple(point): row for row, point in enumerate(points.tolist())}
    around = ((0, 0), (1, 0), (1, 1), (0, 1))
    cube = [number[x, y, z] for z in (0, 1) for x, y in around]
    wedges = [
        [number[x + 1, y, z] for z in (0, 1) for x, y in base]
        for base in (((0, 0), (1, 0), (1, 1)), ((0, 0), (1, 1), (0, 1)))
    ]
    lists = [np.array(item) for item in (cube, *wedges)]
    return (
        b"# vtk DataFile Version 3.0\nby hand\nASCII\nDATASET UNSTRUCTURED_GRID\n"
        + b"POINTS 12 float\n"
        + text_rows(points)
        + _lists("CELLS", lists, binary=False, new=False)
        + b"CELL_TYPES 3\n12\n13\n13\n"
    )
