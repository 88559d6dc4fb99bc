"""Writers of OBJ and STL files."""

from __future__ import annotations

from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from service.formats.colors import find_colors
from service.formats.errors import UnsupportedFileError
from service.formats.writers.outgoing import Outgoing, to_float32

_BLOCK_ROWS = 100_000
"""Rows that are turned into text at once, to bound the memory."""


def write_obj(path: Path, cloud: Outgoing) -> None:
    """Write vertices, with colours as fractions behind them, normals and triangles."""
    cloud.drop_non_finite()
    table = cloud.points.astype(np.float64)
    if (colors := find_colors(cloud.columns)) is not None:
        if not colors.fit_8_bits:
            cloud.notes.append("the colours are rounded to 8 bits")
        table = np.hstack([table, np.round(colors.to_8_bits() / 255, 6)])
        cloud.take(colors.names)
    normals = cloud.take_normals()
    cloud.drop_columns(list(cloud.columns))
    corner = "{0}" if normals is None else "{0}//{0}"
    with path.open("w", encoding="ascii", newline="\n") as file:
        _write_rows(file, "v", table, is_float32=cloud.points.dtype == np.float32)
        if normals is not None:
            _write_rows(file, "vn", normals, is_float32=normals.dtype == np.float32)
        for a, b, c in () if cloud.faces is None else (cloud.faces + 1).tolist():
            file.write(f"f {corner.format(a)} {corner.format(b)} {corner.format(c)}\n")


def write_stl(path: Path, cloud: Outgoing) -> None:
    """Write a binary STL file.

    Raises
    ------
    UnsupportedFileError
        The cloud has no faces.
    """
    if cloud.faces is None or len(cloud.faces) == 0:
        raise UnsupportedFileError(
            "STL holds triangles only, and the source has none; write PLY, OBJ or GLB"
        )
    cloud.drop_non_finite()
    cloud.drop_columns(list(cloud.columns))
    unused = len(cloud.points) - len(np.unique(cloud.faces))
    if unused:
        cloud.notes.append(f"{unused} points at no face are left out")
    note_float32(cloud)
    corners = cloud.points.astype(np.float64)[cloud.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sizes = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, sizes, out=np.zeros_like(normals), where=sizes > 0)
    layout = [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")]
    rows = np.zeros(len(corners), layout)
    rows["normal"], rows["corners"] = normals, to_float32(corners)
    with path.open("wb") as file:
        file.write(b"binary STL".ljust(80) + np.uint32(len(rows)).tobytes() + rows.tobytes())


def note_float32(cloud: Outgoing) -> None:
    """Note by how much float32 rounds the coordinates, if they are in float64."""
    if cloud.points.dtype == np.float32 or len(cloud.points) == 0:
        return
    rounded = np.abs(cloud.points - to_float32(cloud.points)).max()
    if rounded > 0:
        cloud.notes.append(f"the coordinates are rounded to float32, by up to {rounded:.2g}")


def _write_rows(
    file: IO[str], keyword: str, table: NDArray[np.generic], *, is_float32: bool
) -> None:
    for start in range(0, len(table), _BLOCK_ROWS):
        block = table[start : start + _BLOCK_ROWS]
        rows = block.astype(np.float32) if is_float32 else block.tolist()
        file.writelines(f"{keyword} {' '.join(map(str, row))}\n" for row in rows)
