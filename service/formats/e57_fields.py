"""Fields of E57 scans beside the coordinates: colours, intensity, normals, extensions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.formats.libraries import import_library

_NAMES = {
    "intensity": "intensity",
    "colorRed": "red",
    "colorGreen": "green",
    "colorBlue": "blue",
    "rowIndex": "row_index",
    "columnIndex": "column_index",
    "timeStamp": "time",
    "returnIndex": "return_index",
    "returnCount": "return_count",
    "nor:normalX": "nx",
    "nor:normalY": "ny",
    "nor:normalZ": "nz",
}
"""Names of attributes by the fields of the standard and of its extension for normals."""
_NORMALS = ("nor:normalX", "nor:normalY", "nor:normalZ")
_NO_ATTRIBUTES = ("cartesian", "spherical", "isColorInvalid", "isIntensityInvalid", "isTimeStamp")
"""Beginnings of fields that are coordinates, or say that others are not valid."""
_MAX_FIELDS = 64
LONG = np.longlong
"""Type of buffers of whole numbers: pye57 takes the letter of int64, "l", for 32 bits."""
_INTEGER_TYPES = ("u1", "i1", "u2", "i2", "u4", "i4", "i8")


@dataclass(frozen=True, slots=True)
class Fields:
    """The fields to read beside the coordinates."""

    names: dict[str, str] = field(default_factory=dict)
    """Fields of the file by the names of attributes."""
    types: dict[str, str] = field(default_factory=dict)
    """NumPy's type that holds each field."""
    warnings: tuple[str, ...] = ()


def select_fields(headers: Sequence[Any]) -> Fields:
    """Select the fields of numbers that all scans have; a warning names the others."""
    found = [_read_types(header) for header in headers]
    common = [name for name in found[0] if all(name in types for types in found)] if found else []
    names: dict[str, str] = {}
    types: dict[str, str] = {}
    for item in common[:_MAX_FIELDS]:
        name = _NAMES.get(item, item.partition(":")[2] or item)
        if name in names:
            continue
        names[name] = item
        types[item] = str(np.result_type(*(np.dtype(kinds[item]) for kinds in found)).str[1:])
    others = sorted({name for kinds in found for name in kinds} - set(names.values()))
    listed = ", ".join(repr(name[:40]) for name in others[:9])
    warnings = (f"fields that not all scans have are not kept: {listed}",) if others else ()
    return Fields(names, types, warnings)


def add_buffers(
    image_file: Any, fields: Fields, capacity: int, data: dict[str, Any], buffers: Any
) -> None:
    """Add a buffer for each field to those of the coordinates."""
    libe57 = import_library("pye57").libe57
    for name, kind in fields.types.items():
        is_whole = np.dtype(kind).kind in "iu"
        data[name] = np.empty(capacity, LONG if is_whole else kind)
        buffers.append(libe57.SourceDestBuffer(image_file, name, data[name], capacity, True, True))


def rotate_normals(columns: dict[str, NDArray[np.generic]], R: NDArray[np.float64]) -> None:
    """Turn the normals of a scan into the frame of the file."""
    if all(name in columns for name in _NORMALS):
        turned = np.stack([columns[name] for name in _NORMALS], axis=1) @ R.T
        for name, column in zip(_NORMALS, turned.T, strict=True):
            columns[name] = column.astype(columns[name].dtype)


def _read_types(header: Any) -> dict[str, str]:
    """Return the fields of numbers, with the smallest type that holds what they announce."""
    libe57 = import_library("pye57").libe57
    prototype = libe57.StructureNode(header.points.prototype())
    types: dict[str, str] = {}
    for index in range(prototype.childCount()):
        node = prototype.get(index)
        name = str(node.elementName())
        if name.startswith(_NO_ATTRIBUTES):
            continue
        if node.type() == libe57.NodeType.E57_INTEGER:
            types[name] = _integer_type(libe57.IntegerNode(node))
        elif node.type() == libe57.NodeType.E57_FLOAT:
            is_single = libe57.FloatNode(node).precision() == libe57.E57_SINGLE
            types[name] = "f4" if is_single else "f8"
        elif node.type() == libe57.NodeType.E57_SCALED_INTEGER:
            types[name] = "f8"
    return types


def _integer_type(node: Any) -> str:
    low, high = node.minimum(), node.maximum()
    for kind in _INTEGER_TYPES:
        bounds = np.iinfo(kind)
        if bounds.min <= low and high <= bounds.max:
            return kind
    return "i8"
