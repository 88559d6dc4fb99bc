"""Names of the columns that hold coordinates and normals."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Sequence

_XYZ = (
    ("x", "y", "z"),
    ("px", "py", "pz"),
    ("pos_x", "pos_y", "pos_z"),
    ("point_x", "point_y", "point_z"),  # ArcGIS
    ("x1", "y1", "z1"),  # Ouster
    ("points:0", "points:1", "points:2"),  # ParaView
    ("points_0", "points_1", "points_2"),
    ("points_m_xyz:0", "points_m_xyz:1", "points_m_xyz:2"),  # VeloView
)
_SURVEY = (
    frozenset(
        (
            *("easting", "eastings", "east", "e", "utm_e", "utme", "e_utm", "x_utm", "utm_x"),
            *("rechtswert", "rechts", "ostwert", "ost", "este", "est", "x", "coord_x"),
            *("leste", "øst", "oest", "öst", "oost", "itä", "vychod", "východ", "wschód", "wschod"),
            *("восток", "东", "东坐标", "東", "東座標"),
        )
    ),
    frozenset(
        (
            *("northing", "northings", "north", "n", "utm_n", "utmn", "n_utm", "y_utm", "utm_y"),
            *("hochwert", "hoch", "nordwert", "nord", "norte", "y", "coord_y"),
            *("noord", "norr", "pohjoinen", "sever", "północ", "polnoc", "север", "北", "北坐标"),
            "北座標",
        )
    ),
    frozenset(
        (
            *("elevation", "elev", "height", "altitude", "alt", "up", "h", "z", "level"),
            *("höhe", "hoehe", "cota", "quota", "kote", "altura", "hauteur", "hohe"),
            *("hoogte", "høyde", "hoyde", "højde", "höjd", "korkeus", "výška", "vyska", "wysokość"),
            *("wysokosc", "высота", "отметка", "高程", "標高", "高さ", "altitud", "altitudine"),
        )
    ),
)
"""Names of surveyors for east, north and height, in some languages."""
_PLACE_WORDS = frozenset(
    (
        *("", "coord", "coords", "coordinate", "coordinates", "koordinate", "pos", "position"),
        *("coördinaat", "coordinaat", "coordenada", "coordonnée", "coordonnee", "coordinata"),
        *("koordinat", "koordinata", "координата", "坐标", "座標"),
        *("point", "points", "pt", "loc", "location", "world", "local", "global", "cartesian"),
        *("scan", "xyz", "geometry", "vertex", "map", "utm"),
    )
)
"""Words around the letter of an axis in the names of coordinates: x_coord, point.x, Coord. X."""
_WORD = re.compile(
    r"[\W_]+|(?<=[xyz])(?=coord|pos|utm|local|global|world|[\u3000-\u9fff])"
    r"|(?<=[\u3000-\u9fff])(?=[xyz])"
)
"""Place between words; xcoord and x座標 are two."""
_AXIS = re.compile("[xyz]")
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
_UNITS = ("_mm", "_cm", "_km", "_m", "_ft", "_in")
_POLAR = {"range", "azimuth", "theta", "phi", "rho", "bearing", "inclination", "zenith", "distance"}
_LATITUDES = {"lat", "latitude", "glat", "breite"}
_LONGITUDES = {"lon", "long", "lng", "longitude", "glon", "laenge", "länge"}
_COMMON = {
    *("id", "index", "point", "nr", "name", "time", "timestamp", "t", "gpstime", "gps_time"),
    *("intensity", "i", "reflectance", "reflectivity", "amplitude", "range", "distance"),
    *("azimuth", "elevation", "r", "g", "b", "a", "red", "green", "blue", "alpha", "rgb"),
    *("class", "classification", "label", "ring", "laser_id", "channel", "return", "error"),
    *("alt", "altitude", "height", "z", "shotnumber", "velocity", "snr", "doppler", "weight"),
}
"""Names of columns that are no coordinates of their own."""


def find_xyz(names: Sequence[str]) -> tuple[int, ...] | None:
    """Find the indices of the columns x, y and z; None unless each is there once."""
    bare = [_normalize(name) for name in names]
    return _find_triple(names, _XYZ) or _find_survey(bare) or _find_axes(bare)


def find_normals(names: Sequence[str]) -> tuple[int, ...] | None:
    """Find the indices of the components of the normal; None unless each is there once."""
    return _find_triple(names, _NORMALS)


def find_vectors(names: Sequence[str]) -> list[tuple[int, ...]]:
    """Find the indices of the components of all attributes with a direction."""
    found = (_find_triple(names, [triple]) for triple in _VECTORS)
    return [columns for columns in found if columns is not None]


def are_geographic(names: Sequence[str]) -> bool:
    """Whether there are columns of latitude and longitude."""
    bare = {_normalize(name) for name in names}
    return bool(bare & _LATITUDES and bare & _LONGITUDES)


def are_column_names(names: Sequence[str]) -> bool:
    """Whether words of a comment are likely names of columns, and no prose."""
    known = _COMMON | _LATITUDES | _LONGITUDES
    count = sum(_normalize(name) in known for name in names)
    is_upper_case = bool(names) and all(
        name == name.upper() and name[:1].isalpha() for name in names
    )
    return is_upper_case or 2 * count >= len(names) > 0


def _find_triple(
    names: Sequence[str], triples: Sequence[tuple[str, ...]]
) -> tuple[int, ...] | None:
    if len(names) < 3:
        return None
    bare = [_normalize(name) for name in names]
    known = set(bare)
    for triple in triples:
        if known.issuperset(triple) and all(bare.count(part) == 1 for part in triple):
            return tuple(bare.index(part) for part in triple)
    return None


def _find_survey(bare: Sequence[str]) -> tuple[int, ...] | None:
    """Find east, north and height by the names of surveyors; x and y alone are not theirs."""
    found = [[i for i, name in enumerate(bare) if name in known] for known in _SURVEY]
    if any(len(places) != 1 for places in found):
        return None
    return tuple(places[0] for places in found)


def _find_axes(bare: Sequence[str]) -> tuple[int, ...] | None:
    """Find three names that are alike but for the letter of their axis, among words for places.

    That of z may be a word for heights.
    """
    axes: dict[str, list[tuple[int, str]]] = {"x": [], "y": [], "z": []}
    for place, name in enumerate(bare):
        if not _AXIS.search(name):
            continue
        words = _WORD.split(name)
        letters = [word for word in words if word in axes]
        others = [word for word in words if word not in axes]
        if len(letters) == 1 and _PLACE_WORDS.issuperset(others):
            axes[letters[0]].append((place, " ".join(others)))
    heights = [place for place, name in enumerate(bare) if name in _SURVEY[2]]
    if not axes["z"] and axes["x"] and len(heights) == 1:
        axes["z"] = [(heights[0], axes["x"][0][1])]
    if any(len(found) != 1 for found in axes.values()):
        return None
    columns, kinds = zip(*(found[0] for found in axes.values()), strict=True)
    return columns if len({*kinds}) == 1 else None


def are_other_quantities(names: Sequence[str]) -> bool:
    """Whether most of the names are known, and are no coordinates along axes."""
    known = {name for name in _COMMON if len(name) > 1} - _SURVEY[2] | _POLAR
    return 2 * sum(_normalize(name) in known for name in names) > len(names)


def _normalize(name: str) -> str:
    """Convert to lower case, without quotes and without a unit."""
    bare = name.strip().strip("\"'").lower()
    if not bare.isascii():
        with contextlib.suppress(UnicodeError):  # UTF-8 that was decoded as Latin-1
            bare = name.strip().strip("\"'").encode("latin1").decode("utf8").lower()
    if bare.endswith(("]", ")")):
        openings = [at for at in (bare.find("["), bare.find("(")) if at > 0]
        bare = bare[: min(openings)].rstrip() if openings else bare
    for unit in _UNITS:
        if bare.endswith(unit) and len(bare) > len(unit):
            return bare.removesuffix(unit)
    return bare
