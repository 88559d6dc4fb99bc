"""What the records of LAS say of the coordinate system: its name, and whether it is in degrees."""

from __future__ import annotations

import re
import struct
from collections.abc import Sequence

from service.formats.degrees import ADVICE
from service.formats.errors import UnsupportedFileError
from service.formats.las_metadata import LasRecord

_GEO_KEYS = 34735
"""Record of the GeoTIFF keys."""
_MODEL, _GEOGRAPHIC_CODE, _PROJECTED_CODE, _VERTICAL_CODE = 1024, 2048, 3072, 4096
"""Keys: model type, and EPSG codes of the coordinate systems."""
_GEOGRAPHIC_MODEL = 2
_USER_DEFINED = 32767
_PROJECTED_WORDS = ("PROJCS", "PROJCRS", "PROJECTEDCRS", "GEOCCS", "LOCAL_CS", "ENGCRS")
_GEOGRAPHIC_WORDS = ("GEOGCS", "GEOGCRS", "GEOGRAPHICCRS", "GEODCRS", "GEODETICCRS")
_ROOT_CODE = re.compile(r'(?:AUTHORITY|ID)\["EPSG",\s*"?(\d+)"?\s*\]\s*\]\s*$')
_MAX_NAME = 120


def refuse_geographic(records: Sequence[LasRecord]) -> None:
    """Refuse a coordinate system of longitude and latitude.

    Raises
    ------
    UnsupportedFileError
        The records say so.
    """
    if _is_geographic(records):
        raise UnsupportedFileError(
            f"the coordinate system of the file, {describe_crs(records)}, is in degrees of"
            f" longitude and latitude; expected lengths: {ADVICE}"
        )


def describe_crs(records: Sequence[LasRecord]) -> str | None:
    """Name the coordinate system; None if the records do not tell."""
    text = _well_known_text(records)
    if text:
        name = re.search(r'"([^"]*)"', text)
        return name[1][:_MAX_NAME] if name else None
    keys = _geo_keys(records)
    codes = [
        f"EPSG:{keys[key]}"
        for key in (_PROJECTED_CODE, _GEOGRAPHIC_CODE, _VERTICAL_CODE)
        if 0 < keys.get(key, 0) < _USER_DEFINED
        and (key != _GEOGRAPHIC_CODE or _PROJECTED_CODE not in keys)
    ]
    return " + ".join(codes) or None


def warn_unlike(source: Sequence[LasRecord], target: Sequence[LasRecord]) -> tuple[str, ...]:
    """Warn where source and target are in different coordinate systems."""
    here, there = describe_crs(source), describe_crs(target)
    if here is None or there is None or here == there:
        return ()
    codes = [_root_code(records) for records in (source, target)]
    has_text = [bool(_well_known_text(records)) for records in (source, target)]
    if codes[0] == codes[1] is not None or (has_text[0] != has_text[1] and None in codes):
        return ()
    return (
        f"the coordinate system of the source is {here[:_MAX_NAME]}, that of the target"
        f" {there[:_MAX_NAME]}: they may differ in unit, scale and height; convert both to one",
    )


def _is_geographic(records: Sequence[LasRecord]) -> bool:
    text = _well_known_text(records).upper()
    if text:
        has_degrees = any(f"{word}[" in text for word in _GEOGRAPHIC_WORDS)
        return (
            has_degrees
            and not any(f"{word}[" in text for word in _PROJECTED_WORDS)
            and "CS[CARTESIAN" not in text
        )
    return _geo_keys(records).get(_MODEL) == _GEOGRAPHIC_MODEL


def _root_code(records: Sequence[LasRecord]) -> str | None:
    """Code of the whole coordinate system, where one number says it."""
    text = _well_known_text(records)
    if not text:
        return describe_crs(records)
    code = _ROOT_CODE.search(text)
    return f"EPSG:{code[1]}" if code else None


def _well_known_text(records: Sequence[LasRecord]) -> str:
    for record in records:
        if record.is_wkt:
            return record.data.split(b"\0")[0].decode("utf-8", "replace").strip()
    return ""


def _geo_keys(records: Sequence[LasRecord]) -> dict[int, int]:
    """Return the GeoTIFF keys that are one number."""
    for record in records:
        if record.is_crs and record.record_id == _GEO_KEYS:
            count = len(record.data) // 8
            rows = struct.unpack(f"<{4 * count}H", record.data[: 8 * count])
            entries = [rows[i : i + 4] for i in range(4, len(rows), 4)]
            return {key: value for key, place, _, value in entries if place == 0}
    return {}
