"""Writer of LAS and LAZ files, by laspy and lazrs."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from service.formats.colors import RGB, find_colors
from service.formats.las_metadata import LasMetadata
from service.formats.libraries import import_library
from service.formats.writers.las_dimensions import (
    WAVEFORM_NAMES,
    Placed,
    find_dimensions,
    place_column,
)
from service.formats.writers.outgoing import Columns, Outgoing
from service.formats.writers.row_format import Append

_LAS_STEPS = 2_000_000_000
"""Steps of the scale across the extent; LAS stores 32-bit counts of it."""
_RELATIVE_STEP = 1e-8
"""Step of the scale as a share of the extent, where the source has no scale of its own."""
_FORBIDDEN = re.compile(r"[\s\x00-\x1f\x7f:]")
"""Characters of names: laspy writes rows as a buffer, whose fields have no colon."""
_MAX_NAME_BYTES = 32
_MAX_ROW_BYTES = 60_000
"""Bytes of a point; LAS counts them in 16 bits."""
_WITHOUT_WAVEFORMS = {4: 1, 5: 3, 9: 6, 10: 8}
"""Point formats with waveforms, and the same without."""
_PLAIN, _WITH_COLORS, _WITH_NIR = 6, 7, 8
"""Point formats of LAS 1.4."""


def write(path: Path, cloud: Outgoing, *, is_compressed: bool) -> None:
    """Write LAS or LAZ: as the source was if it was LAS, else 1.4 with point format 6, 7 or 8.

    Attributes that the point format does not know become extra bytes. Non-finite points are left
    out: LAS cannot hold them.

    Raises
    ------
    MissingLibraryError
        laspy is not installed.
    """
    encoded = _encode(cloud)
    with _open(path, encoded.header, is_compressed=is_compressed) as file:
        file.write_points(encoded.to_record(len(cloud.points)))


@contextmanager
def open_pieces(
    path: Path, model: Outgoing, count: int, *, is_compressed: bool
) -> Iterator[Append]:
    """Begin a file whose columns have the ranges of the model's; see `RowFormat.open`."""
    header = _encode(model).header
    with _open(path, header, is_compressed=is_compressed) as file:

        def append(cloud: Outgoing, surplus: int) -> None:
            encoded = replace(_encode(cloud), header=header)
            file.write_points(encoded.to_record(len(cloud.points) - surplus))

        yield append


@dataclass(frozen=True, slots=True)
class _Encoded:
    """Header and columns of a file."""

    header: Any
    cloud: Outgoing
    standard: Columns
    """Dimensions of the point format."""
    extra: Columns
    """Dimensions in extra bytes."""

    def to_record(self, count: int) -> Any:
        """Return the first points as laspy writes them."""
        laspy = import_library("laspy")
        record = laspy.ScaleAwarePointRecord.zeros(count, header=self.header)
        record.x, record.y, record.z = self.cloud.points[:count].T.astype(np.float64)
        for name, column in self.standard.items():
            record[name] = column[:count]
        for name, column in self.extra.items():
            record.array[name] = column[:count]
        return record


def _encode(cloud: Outgoing) -> _Encoded:
    laspy = import_library("laspy")
    cloud.drop_faces()
    cloud.drop_non_finite()
    cloud.drop_columns(WAVEFORM_NAMES)
    _use_16_bit_colors(cloud)
    cloud.rename(_FORBIDDEN, _MAX_NAME_BYTES)
    header = _make_header(laspy, cloud)
    standard, extra = _place_columns(cloud, header.point_format)
    header.add_extra_dims(
        [
            laspy.ExtraBytesParams(name, column.dtype, _description(cloud.las, name))
            for name, column in extra.items()
        ]
    )
    return _Encoded(header, cloud, standard, extra)


def _open(path: Path, header: Any, *, is_compressed: bool) -> Any:
    laspy = import_library("laspy")
    backend = laspy.LazBackend.Lazrs
    return laspy.open(path, "w", header=header, do_compress=is_compressed, laz_backend=backend)


def _make_header(laspy: Any, cloud: Outgoing) -> Any:
    """Make the header: point format, scale, records, coordinate system, type of GPS time."""
    kind, version = _choose_format(laspy, cloud)
    header = laspy.LasHeader(point_format=kind, version=version)
    points = cloud.points.astype(np.float64)
    low, high = (points.min(axis=0), points.max(axis=0)) if len(points) else (np.zeros(3),) * 2
    header.offsets = np.round((low + high) / 2)
    header.scales = np.full(3, _choose_scale(cloud.las, float((high - low).max())))
    kept = () if cloud.las is None else cloud.las.records
    for record in (*kept, *cloud.crs):
        header.vlrs.append(
            laspy.VLR(record.user_id, record.record_id, record.description, record.data)
        )
    header.global_encoding.wkt = any(record.is_wkt for record in cloud.crs)
    if cloud.las is not None and cloud.las.has_standard_time:
        header.global_encoding.gps_time_type = laspy.header.GpsTimeType.STANDARD
    return header


def _choose_format(laspy: Any, cloud: Outgoing) -> tuple[int, str]:
    """Return the source's point format if it holds all attributes, else one of LAS 1.4."""
    has_wkt = any(record.is_wkt for record in cloud.crs)
    has_colors = all(name in cloud.columns for name in RGB)
    if cloud.las is not None:
        kind = _WITHOUT_WAVEFORMS.get(cloud.las.point_format, cloud.las.point_format)
        known = set(laspy.PointFormat(kind).dimension_names)
        wanted = set(find_dimensions(cloud.columns)) & _names_of_las(laspy)
        if wanted <= known:
            version = "1.4" if has_wkt or kind > 5 else max(cloud.las.version, "1.2")
            return kind, version
    if has_colors:
        return (_WITH_NIR if "nir" in cloud.columns else _WITH_COLORS), "1.4"
    return _PLAIN, "1.4"


def _names_of_las(laspy: Any) -> set[str]:
    return set(laspy.PointFormat(_WITH_NIR).dimension_names) | {"scan_angle_rank"}


def _choose_scale(las: LasMetadata | None, extent: float) -> float:
    """Return the source's step, or a power of ten; coarser if 32 bits cannot span the extent."""
    needed = extent / _LAS_STEPS
    if las is not None and las.scale is not None and las.scale > needed:
        return las.scale
    if las is None or las.scale is None:
        needed = extent * _RELATIVE_STEP
    return float(10.0 ** np.ceil(np.log10(needed))) if needed > 0 else 1e-3


def _use_16_bit_colors(cloud: Outgoing) -> None:
    """Turn colours into red, green and blue of 16 bits, as LAS demands; those of LAS stay."""
    colors = find_colors(cloud.columns)
    if colors is None or (cloud.las is not None and colors.values.dtype == np.uint16):
        return
    values = colors.to_16_bits()
    cloud.take(colors.names)
    cloud.columns |= dict(zip(RGB, values.T, strict=True))


def _place_columns(cloud: Outgoing, point_format: Any) -> tuple[Columns, Columns]:
    """Divide the columns into dimensions of the point format and extra bytes."""
    standard: Columns = {}
    extra: Columns = {}
    dimensions = find_dimensions(cloud.columns)
    names = {column: dimension for dimension, column in dimensions.items()}
    room = _MAX_ROW_BYTES
    for name, column in cloud.columns.items():
        placed = place_column(names.get(name), column, point_format)
        if placed.standard is not None:
            standard[placed.dimension] = placed.standard
        if placed.note:
            cloud.notes.append(f"{name[:40]!r} {placed.note}")
        if placed.is_whole:
            continue
        room -= column.dtype.itemsize
        if room < 0:
            cloud.notes.append(f"{name[:40]!r} is left out: LAS has no more room in a point")
        else:
            extra[_extra_name(name, placed, point_format, extra)] = column
    return standard, extra


def _extra_name(name: str, placed: Placed, point_format: Any, taken: Columns) -> str:
    """Return a name that is no dimension of the point format."""
    known = set(point_format.dimension_names) | set(taken) | {"raw_classification"}
    if name not in known:
        return name
    end = "_original"
    free = name[: _MAX_NAME_BYTES - len(end)] + end
    return free if free not in known else f"{free[:28]}_{len(taken)}"


def _description(las: LasMetadata | None, name: str) -> str:
    return "" if las is None else las.descriptions.get(name, "")[:_MAX_NAME_BYTES]
