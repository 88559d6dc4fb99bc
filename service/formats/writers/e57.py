"""Writer of E57 files: one scan in the frame of the file, by libE57."""

from __future__ import annotations

import re
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from service.formats.colors import RGB, find_colors
from service.formats.e57_fields import LONG
from service.formats.libraries import import_library
from service.formats.writers.outgoing import Columns, Outgoing
from service.formats.writers.row_format import Append

_CHUNK_POINTS = 500_000
NORMALS_URI = "http://www.libe57.org/E57_NOR_surface_normals.txt"
"""Namespace of the extension for normals, whose prefix is "nor"."""
ATTRIBUTES_URI = "urn:mpe:e57:attributes"
"""Namespace of the extension for attributes that E57 does not know; its prefix is "mpe"."""
_FORBIDDEN = re.compile(r"[^A-Za-z0-9_]")
_STANDARD = {"intensity": "intensity", "row_index": "rowIndex", "column_index": "columnIndex"}
_MAX_INTEGER = 1 << 62
_STATE, _INVALID = "cartesianInvalidState", 2
"""Column that marks points without coordinates, and its mark."""
Limits = dict[str, dict[str, float]]
"""Smallest and largest values that a scan states, by the names of E57."""


def write(path: Path, cloud: Outgoing) -> None:
    """Write all points in the order of the source; those without coordinates are marked invalid.

    Raises
    ------
    MissingLibraryError
        pye57 is not installed.
    """
    cloud.drop_faces()
    limits, columns = _fields(cloud, has_states=not np.isfinite(cloud.points).all())
    with _open_scan(path, limits, columns) as append:
        append(columns)


@contextmanager
def open_pieces(path: Path, model: Outgoing, count: int) -> Iterator[Append]:
    """Begin a file whose columns have the ranges of the model's; see `RowFormat.open`."""
    del count  # libE57 counts the points
    with _open_scan(path, *_fields(model, has_states=True)) as write_columns:

        def append(cloud: Outgoing, surplus: int) -> None:
            _, columns = _fields(cloud, has_states=True)
            write_columns({name: column[:-surplus] for name, column in columns.items()})

        yield append


def _fields(cloud: Outgoing, *, has_states: bool) -> tuple[Limits, Columns]:
    """Return the limits that a scan states, and the columns by the names of E57.

    `has_states` adds the column that marks points without coordinates.
    """
    finite = np.isfinite(cloud.points).all(axis=1)
    points = np.where(finite[:, None], cloud.points, 0)
    columns: Columns = {f"cartesian{axis}": points[:, i] for i, axis in enumerate("XYZ")}
    if has_states:
        columns[_STATE] = np.where(finite, 0, _INVALID).astype(np.int64)
    limits: Limits = {}
    if (colors := find_colors(cloud.columns)) is not None:
        white = 255 if colors.fit_8_bits else 65535
        values = colors.to_8_bits() if white == 255 else colors.to_16_bits()
        cloud.take(colors.names)
        parts = [f"color{name.capitalize()}" for name in RGB]
        columns |= dict(zip(parts, values.T.astype(np.int64), strict=True))
        limits["colorLimits"] = {f"{part}Minimum": 0 for part in parts}
        limits["colorLimits"] |= {f"{part}Maximum": white for part in parts}
    if (normals := cloud.take_normals()) is not None:
        columns |= {f"nor:normal{axis}": normals[:, i] for i, axis in enumerate("XYZ")}
    cloud.rename(_FORBIDDEN)
    for name, column in cloud.columns.items():
        columns[_STANDARD.get(name, f"mpe:{name}")] = column
    if "intensity" in columns and np.isfinite(columns["intensity"].astype(float)).any():
        values = columns["intensity"].astype(float)
        bounds = float(np.nanmin(values)), float(np.nanmax(values))
        limits["intensityLimits"] = dict(
            zip(("intensityMinimum", "intensityMaximum"), bounds, strict=True)
        )
    return limits, columns


@contextmanager
def _open_scan(path: Path, limits: Limits, model: Columns) -> Iterator[Callable[[Columns], None]]:
    """Begin a file of one scan, whose columns have the types and ranges of the model's."""
    pye57 = import_library("pye57")
    libe57 = pye57.libe57
    file = pye57.E57(str(path), mode="w")
    image = file.image_file
    image.extensionsAdd("nor", NORMALS_URI)
    image.extensionsAdd("mpe", ATTRIBUTES_URI)
    prototype, buffers = libe57.StructureNode(image), libe57.VectorSourceDestBuffer()
    arrays: Columns = {}
    for name, column in model.items():
        bounds = np.array([0, _INVALID]) if name == _STATE else column
        node, kind = _prototype_node(libe57, image, bounds)
        prototype.set(name, node)
        arrays[name] = np.empty(_CHUNK_POINTS, kind)
        buffers.append(
            libe57.SourceDestBuffer(image, name, arrays[name], _CHUNK_POINTS, True, True)
        )
    scan = _make_scan(libe57, image, limits)
    points = libe57.CompressedVectorNode(image, prototype, libe57.VectorNode(image, True))
    scan.set("points", points)
    file.data3d.append(scan)
    writer = points.writer(buffers)

    def append(columns: Columns) -> None:
        count = len(columns["cartesianX"])
        for start in range(0, count, _CHUNK_POINTS):
            part = min(_CHUNK_POINTS, count - start)
            for name, array in arrays.items():
                array[:part] = columns[name][start : start + part]
            writer.write(part)

    yield append
    writer.close()
    file.close()


def _make_scan(libe57: Any, image: Any, limits: Limits) -> Any:
    """Return the node of a scan, which states the limits of its colours and intensity."""
    scan = libe57.StructureNode(image)
    scan.set("guid", libe57.StringNode(image, f"{{{uuid.uuid4()}}}"))
    scan.set("name", libe57.StringNode(image, "aligned"))
    for name, bounds in limits.items():
        node = libe57.StructureNode(image)
        is_whole = name == "colorLimits"
        for key, value in bounds.items():
            kind = libe57.IntegerNode if is_whole else libe57.FloatNode
            node.set(key, kind(image, value))
        scan.set(name, node)
    return scan


def _prototype_node(libe57: Any, image: Any, column: NDArray[np.generic]) -> tuple[Any, DTypeLike]:
    """Return the node that describes a column, and the type of its buffer."""
    if column.dtype.kind in "iu" and len(column):
        low, high = int(column.min()), int(column.max())
        if low > -_MAX_INTEGER and high < _MAX_INTEGER:
            return libe57.IntegerNode(image, low, low, high), LONG
    if column.dtype == np.float32:
        return libe57.FloatNode(image, 0.0, libe57.E57_SINGLE), "f4"
    return libe57.FloatNode(image, 0.0, libe57.E57_DOUBLE), "f8"
