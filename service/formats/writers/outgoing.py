"""A cloud on its way into a file: its columns, and notes of what the format cannot hold."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from service.formats.colors import RGB, find_colors, unpack_colors
from service.formats.column_names import find_normals
from service.formats.decoded_cloud import DecodedCloud
from service.formats.las_metadata import LasMetadata, LasRecord

Columns = dict[str, NDArray[np.generic]]
_MAX_NAMES = 20
"""Names that a note lists."""
MAX_FLOAT32_ROUNDING = 1e-6
"""Rounding by float32, as a share of the cloud's extent, that is little."""
_CONTROL = re.compile(r"[\s\x00-\x1f\x7f]")


@dataclass(slots=True)
class Outgoing:
    """Points and columns to write; the writer adds notes for the caller."""

    points: NDArray[np.floating]
    """(N, 3)."""
    columns: Columns
    """(N,) numbers by name; no name is that of a coordinate, and packed colours are unpacked."""
    faces: NDArray[np.int64] | None
    """(F, 3) triangles."""
    viewpoint: tuple[float, ...] | None
    """Pose of the scanner, if there is one alone."""
    las: LasMetadata | None
    crs: tuple[LasRecord, ...]
    notes: list[str] = field(default_factory=list)
    """What is changed or left out."""

    @classmethod
    def of(cls, cloud: DecodedCloud) -> Outgoing:
        """Take a cloud; attributes called x, y or z get other names."""
        viewpoint = cloud.viewpoints[0] if len(cloud.viewpoints) == 1 else None
        outgoing = cls(cloud.points, {}, cloud.faces, viewpoint, cloud.las, cloud.crs)
        for name, column in unpack_colors(cloud.attributes).items():
            if column.dtype.kind not in "biuf":
                outgoing.notes.append(f"{name[:40]!r} is left out: it holds no numbers")
                continue
            outgoing.columns[outgoing._free_name(name)] = _to_plain_type(column)
        return outgoing

    def rename(self, forbidden: re.Pattern[str] = _CONTROL, max_bytes: int = 200) -> None:
        """Replace forbidden characters in names, and shorten them; names stay different."""
        renamed: Columns = {}
        for name, column in self.columns.items():
            bare = forbidden.sub("_", name).encode()[:max_bytes].decode(errors="ignore")
            unique, number = bare, 2
            while unique in renamed:
                end = f"_{number}"
                unique = bare.encode()[: max_bytes - len(end)].decode(errors="ignore") + end
                number += 1
            if len(name.encode()) > max_bytes:
                self.notes.append(f"{name[:60]!r} is called {unique!r}: longer names are cut")
            renamed[unique] = column
        self.columns = renamed

    def use_8_bit_colors(self) -> None:
        """Turn colours into red, green and blue of 8 bits, which viewers expect."""
        colors = find_colors(self.columns)
        if colors is None or (set(RGB) & set(self.columns)) - set(colors.names):
            return
        if not colors.fit_8_bits:
            self.notes.append("the colours are rounded to 8 bits")
        places = dict(zip(colors.names, range(3), strict=True))
        values = colors.to_8_bits()
        self.columns = {
            RGB[places[name]] if name in places else name: (
                values[:, places[name]] if name in places else column
            )
            for name, column in self.columns.items()
        }

    def take(self, names: Iterable[str]) -> NDArray[np.generic]:
        """Remove columns of the same kind, and return them as (N, len(names))."""
        return np.stack([self.columns.pop(name) for name in names], axis=1)

    def take_normals(self) -> NDArray[np.generic] | None:
        """Remove the normals, and return them as (N, 3)."""
        names = list(self.columns)
        found = find_normals(names)
        return None if found is None else self.take(names[i] for i in found)

    def drop_non_finite(self) -> None:
        """Leave out points without coordinates, and the faces at them."""
        finite = np.isfinite(self.points).all(axis=1)
        if finite.all():
            return
        count = len(finite) - int(finite.sum())
        self.notes.append(f"{count} points without finite coordinates are left out")
        if self.faces is not None:
            whole = finite[self.faces].all(axis=1)
            self.faces = (np.cumsum(finite) - 1)[self.faces[whole]]
        self.points = self.points[finite]
        self.columns = {name: column[finite] for name, column in self.columns.items()}

    def use_float32(self) -> None:
        """Round the coordinates to float32 where that is little; note it, or that it is much."""
        finite = self.points[np.isfinite(self.points).all(axis=1)]
        if self.points.dtype == np.float32 or len(finite) == 0:
            return
        rounded = float(np.abs(finite - to_float32(finite)).max())
        if rounded > MAX_FLOAT32_ROUNDING * np.ptp(finite, axis=0).max():
            self.notes.append(
                "the coordinates are in float64, which many viewers do not read from this format; "
                f"float32 would round them by {rounded:.2g}: write PLY or LAZ"
            )
            return
        if rounded:
            self.notes.append(f"the coordinates are rounded to float32, by up to {rounded:.2g}")
        self.points = self.points.astype(np.float32)

    def drop_faces(self) -> None:
        """Note that the format has no faces."""
        if self.faces is not None and len(self.faces):
            self.notes.append(f"the {len(self.faces)} faces are left out: write PLY, OBJ or GLB")

    def drop_columns(self, names: Iterable[str]) -> None:
        """Leave out columns, and note their names."""
        dropped = [name for name in names if name in self.columns]
        for name in dropped:
            del self.columns[name]
        if dropped:
            listed = ", ".join(repr(name[:40]) for name in dropped[:_MAX_NAMES])
            more = ", ..." if len(dropped) > _MAX_NAMES else ""
            self.notes.append(f"left out, because the format cannot hold them: {listed}{more}")

    def _free_name(self, name: str) -> str:
        if name.strip().lower() not in ("", "x", "y", "z"):
            return name
        free = f"attribute_{name.strip()}".rstrip("_")
        self.notes.append(f"the attribute {name!r} is called {free!r}, as it is no coordinate")
        return free


def to_float32(values: NDArray[np.generic]) -> NDArray[np.float32]:
    """Round to float32; values beyond its range become infinite."""
    with np.errstate(over="ignore"):
        return values.astype(np.float32)


def to_rows(points: NDArray[np.floating], columns: Columns) -> NDArray[np.void]:
    """Build an (N,) structured little-endian array: x, y, z, then the columns."""
    kind = "<f8" if points.dtype.itemsize > 4 else "<f4"
    layout = [(axis, kind) for axis in "xyz"]
    layout += [(name, f"<{column.dtype.str[1:]}") for name, column in columns.items()]
    rows = np.empty(len(points), np.dtype(layout))
    for name, column in (dict(zip("xyz", points.T, strict=True)) | columns).items():
        rows[name] = column
    return rows


def _to_plain_type(column: NDArray[np.generic]) -> NDArray[np.generic]:
    """Return booleans as bytes, and floats as float32 or float64."""
    if column.dtype.kind == "b":
        return column.astype(np.uint8)
    if column.dtype.kind == "f" and column.dtype.itemsize not in (4, 8):
        return column.astype(np.float32 if column.dtype.itemsize < 4 else np.float64)
    return column
