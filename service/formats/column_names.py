"""Names of the columns that hold coordinates and normals."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from functools import lru_cache

from service.formats.column_words import (
    COMMON,
    LATITUDES,
    LONGITUDES,
    PLACE_WORDS,
    POLAR,
    QUALIFIERS,
    SURVEY,
    SYSTEMS,
)

_XYZ = (("x", "y", "z"),)
_PLANE = SURVEY[0] | SURVEY[1]
_OTHER_XYZ = (
    ("px", "py", "pz"),
    ("pos_x", "pos_y", "pos_z"),
    ("point_x", "point_y", "point_z"),  # ArcGIS
)
_NUMBERED_AXIS = re.compile(r"([xyz])_?(\d{1,2})")
"""x1 of Ouster."""
_ENU = (("e", "n", "u"),)
_NUMBERED = re.compile(
    r"(points|points_m_xyz|xyz|location|position|coords|coordinates)[\W_]*([0-3])\W*"
)
"""Parts of one array: Points:0 of ParaView, xyz_1 of MATLAB."""
_WORD = re.compile(
    r"[\W_]+|(?<=[xyz])(?=coord|pos|utm|val|local|global|world|[\u3000-\u9fff\uac00-\ud7af])"
    r"|(?<=[\u3000-\u9fff\uac00-\ud7af])(?=[xyz])"
)
"""Place between words; xcoord and x座標 are two."""
_BETWEEN = re.compile(r"[\s.\-]+")
_BRACKETED_AXIS = re.compile(r"[\[({]([xyzXYZ])[\])}]")
_MAX_NAME_CHARACTERS = 200
"""Characters from which on a text is no name: a unit is looked for in quadratic time."""
_MIN_SURVEY_WORD = 4
"""Letters of a word for a direction beside an axis: X/East, but not X_est, an estimate."""
_LAST_CAPITAL = re.compile(r"(?<=[a-z])(?=[XYZ](?![A-Za-z]))")
"""Place before the axis in PosX."""
_UNIT = re.compile(
    r"(?:(?<=.)[\s_/:,-]+(?:in[\s_]+)?|(?<=\b[xyz])(?=mm|cm|ft))"
    r"(?:mm|cm|km|m|ft|in|feet|foot|inch|(?:milli|centi|kilo)?met(?:er|re)s?|usft"
    r"|us survey f(?:ee|oo)t)$"
)
_DECLARED = re.compile(
    r"(?<=\w)(?<!normals)\s*:\s*(?:\d{1,2}(?:\.\d{1,2})?|[fiu][1248]|[FEDGI]\d{1,2}(?:\.\d{1,2})?"
    r"|float(?:32|64)?|double|real|u?int(?:8|16|32|64)?|u?char|u?short|number|decimal)(?=[\"'`]?\s*$)",
    re.IGNORECASE,
)
"""Digits or type of a column behind its name: X:3, x:f4, y:F8.3, z:double."""
_BESIDE_DEGREES = {"", "x", "y", "z", "deg", "degree", "degrees", "wgs84", "gps", "dd"}
_NORMALS = (
    ("nx", "ny", "nz"),
    ("normal_x", "normal_y", "normal_z"),
    ("normalx", "normaly", "normalz"),
    ("normals:0", "normals:1", "normals:2"),
)
_VECTORS = (
    *_NORMALS,
    ("vx", "vy", "vz"),
    ("velocity_x", "velocity_y", "velocity_z"),
)
"""Attributes with a direction, which turn with the cloud."""


def find_xyz(names: Sequence[str]) -> tuple[int, ...] | None:
    """Find the indices of the columns x, y and z; None unless each is there once.

    Three columns of other names are none where three more may be coordinates too.
    """
    if len(names) < 3:  # each line of a long comment is asked
        return None
    found = _find_triple(names, _XYZ)
    if found is None:
        found = _find_likely(names)
        found = None if found is None or find_further(names, found) else found
    return None if found is None else _with_east_first(names, found)


def _with_east_first(names: Sequence[str], xyz: tuple[int, ...]) -> tuple[int, ...]:
    """Return the columns x, y, z, or y, x, z where their names say that x is north."""
    x, y, z = xyz
    east, north = (_long_words(known) for known in SURVEY[:2])
    beside_x, beside_y = ({*_WORD.split(names[place].lower())} for place in (x, y))
    return (y, x, z) if beside_x & north and beside_y & east else xyz


@lru_cache(maxsize=4)
def _long_words(words: frozenset[str]) -> frozenset[str]:
    """Return the words that are no mere letters, which may mean something else."""
    return frozenset(word for word in words if len(word) >= _MIN_SURVEY_WORD or not word.isascii())


def find_further(names: Sequence[str], xyz: Sequence[int]) -> list[str]:
    """Return the names of three more columns that may be coordinates; nothing without."""
    others = [name for place, name in enumerate(names) if place not in xyz]
    found = _find_triple(others, _XYZ) or _find_likely(others)
    return [] if found is None else [others[place].strip() for place in found]


def _find_likely(names: Sequence[str]) -> tuple[int, ...] | None:
    """Find three columns with names of coordinates other than x, y and z."""
    bare = [normalize_name(name) for name in names]
    return (
        _find_triple(names, _OTHER_XYZ)
        or _find_numbered_axes(bare)
        or _find_numbered(names)
        or _find_survey(bare)
        or _find_axes(names, bare)
        or _find_triple(names, _ENU)
    )


def _find_numbered_axes(bare: Sequence[str]) -> tuple[int, ...] | None:
    """Find x1, y1 and z1, or those of the first number of which all three are there."""
    places: dict[str, dict[str, int]] = {}
    for place, name in enumerate(bare):
        if found := _NUMBERED_AXIS.fullmatch(name):
            places.setdefault(found[2], {})[found[1]] = place
    complete = (axes for axes in places.values() if len(axes) == 3)
    return next((tuple(axes[axis] for axis in "xyz") for axes in complete), None)


def find_normals(names: Sequence[str]) -> tuple[int, ...] | None:
    """Find the indices of the components of the normal; None unless each is there once."""
    return _find_triple(names, _NORMALS)


def find_vectors(names: Sequence[str]) -> list[tuple[int, ...]]:
    """Find the indices of the components of all attributes with a direction."""
    found = (_find_triple(names, [triple]) for triple in _VECTORS)
    return [columns for columns in found if columns is not None]


def are_geographic(names: Sequence[str]) -> bool:
    """Whether there are columns of latitude and longitude."""
    words = [{*_WORD.split(normalize_name(name))} - _BESIDE_DEGREES for name in names]
    return all(any(item and item <= known for item in words) for known in (LATITUDES, LONGITUDES))


def are_column_names(names: Sequence[str]) -> bool:
    """Whether words of a comment are likely names of columns, and no prose."""
    known = COMMON | LATITUDES | LONGITUDES
    count = sum(normalize_name(name) in known for name in names)
    is_upper_case = bool(names) and all(
        name == name.upper() and name[:1].isalpha() for name in names
    )
    return is_upper_case or 2 * count >= len(names) > 0


def _find_triple(
    names: Sequence[str], triples: Sequence[tuple[str, ...]]
) -> tuple[int, ...] | None:
    if len(names) < 3:
        return None
    bare = [normalize_name(name) for name in names]
    known = set(bare)
    for triple in triples:
        if known.issuperset(triple) and all(bare.count(part) == 1 for part in triple):
            return tuple(bare.index(part) for part in triple)
    return None


def _find_survey(bare: Sequence[str]) -> tuple[int, ...] | None:
    """Find east, north and height by the names of surveyors; x and y alone are not theirs."""
    found = [_find_places(bare, known) for known in SURVEY]
    if any(len(places) != 1 for places in found):
        return None
    return tuple(places[0] for places in found)


def _find_places(bare: Sequence[str], known: frozenset[str]) -> list[int]:
    """Find the names that are known, or else known with a qualifying word."""
    exact = [place for place, name in enumerate(bare) if _BETWEEN.sub("_", name) in known]
    words = [{*_WORD.split(name)} for name in bare]
    return exact or [
        place
        for place, found in enumerate(words)
        if len(beside := found - known) < len(found) and beside and beside <= QUALIFIERS
        if all(len(word) > 1 for word in found & known) or (SYSTEMS & beside) == beside
    ]


def _find_numbered(names: Sequence[str]) -> tuple[int, ...] | None:
    """Find the three parts of one array, numbered from 0 or 1."""
    parts: dict[str, dict[int, int]] = {}
    for place, name in enumerate(names):
        if found := _NUMBERED.fullmatch(name.strip().strip("\"'").lower()):
            parts.setdefault(found[1], {})[int(found[2])] = place
    complete = [part for part in parts.values() if sorted(part) in ([0, 1, 2], [1, 2, 3])]
    if len(complete) != 1:
        return None
    return tuple(complete[0][number] for number in sorted(complete[0]))


def _find_axes(names: Sequence[str], bare: Sequence[str]) -> tuple[int, ...] | None:
    """Find three names that are alike but for the letter of their axis, among words for places.

    That of z may be a word for heights.
    """
    axes: dict[str, list[tuple[int, str]]] = {"x": [], "y": [], "z": []}
    plane, height = _long_words(_PLANE), _long_words(SURVEY[2])
    for place, name in enumerate(names):
        words = _WORD.split(normalize_name(_BRACKETED_AXIS.sub(r"_\1", name)))
        letters = [word for word in words if word in axes]
        if len(letters) != 1:
            continue
        others = [word for word in words if word != letters[0]]
        others = [word for word in others if word not in (height if letters == ["z"] else plane)]
        if (QUALIFIERS if letters == ["z"] else PLACE_WORDS).issuperset(others):
            axes[letters[0]].append((place, " ".join(filter(None, others))))
    heights = _find_places(bare, SURVEY[2])
    if not axes["z"] and axes["x"] and len(heights) == 1:
        axes["z"] = [(heights[0], axes["x"][0][1])]
    if any(len(found) != 1 for found in axes.values()):
        return None
    columns, (kind_x, kind_y, kind_z) = zip(*(found[0] for found in axes.values()), strict=True)
    is_datum = not PLACE_WORDS.issuperset(kind_z.split())
    return columns if kind_x == kind_y and (is_datum or kind_z == kind_x) else None


def are_other_quantities(names: Sequence[str]) -> bool:
    """Whether most of the names are known, and are no coordinates along axes."""
    known = {name for name in COMMON if len(name) > 1} - SURVEY[2] | POLAR
    return 2 * sum(normalize_name(name) in known for name in names) > len(names)


def normalize_name(name: str) -> str:
    """Convert to lower case, without quotes, a unit or a type; PosX becomes pos_x."""
    return name.lower() if len(name) > _MAX_NAME_CHARACTERS else _normalize_short(name)


@lru_cache(maxsize=4096)  # many lines of a file are asked, for each delimiter
def _normalize_short(name: str) -> str:
    name = _DECLARED.sub("", name)
    bare = unicodedata.normalize("NFC", name).strip().strip("\"'`")
    bare = _LAST_CAPITAL.sub("_", bare).lower()
    if bare.endswith(("]", ")", "}", ">")):
        openings = [at for sign in "[({<" if (at := bare.find(sign)) > 0]
        bare = bare[: min(openings)].rstrip() if openings else bare
    return _UNIT.sub("", bare)
