"""The header of a PLY file: its elements and their properties."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from typing import Literal

from service.formats.column_names import find_xyz
from service.formats.decoded_cloud import ReadLimits
from service.formats.errors import FileLimitError, MalformedFileError, TruncatedFileError
from service.formats.text_encoding import decode_line, find_line_end

Order = Literal["", "<", ">"]
"""Byte order in NumPy's notation; empty for ASCII."""
_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1",
    "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2",
    "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "int64": "i8", "uint64": "u8", "bool": "u1",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
_CRS = re.compile(
    r"\bEPSG\b|\bcrs\b|\bsrs\b|(?:PROJ|GEOG|GEOC|COMPD|LOCAL_|PROJCRS|GEOGCRS)[A-Z]*\[|\+proj=",
    re.IGNORECASE,
)
"""What a comment that names a coordinate system has in it."""
_MAX_CRS = 100
"""Characters of such a comment in a warning."""
_KEYWORDS = ("ply", "format", "element", "property", "end_header")
_ORDERS: dict[str, Order] = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass(frozen=True, slots=True)
class PlyProperty:
    """A property of an element: a number, or a list of numbers."""

    name: str
    """Name in the file."""
    type: str
    """NumPy's type without byte order: "f4"."""
    count_type: str | None = None
    """Type of the length of a list; None: not a list."""


@dataclass(slots=True)
class PlyElement:
    """An element: a table of rows with the same properties."""

    name: str
    """Name in the file."""
    count: int
    """Number of rows."""
    properties: list[PlyProperty] = field(default_factory=list)
    """Columns of the table."""

    @property
    def has_lists(self) -> bool:
        """Whether any property is a list, so that rows differ in size."""
        return any(item.count_type for item in self.properties)

    def min_row_bytes(self, order: Order) -> int:
        """Return the minimum size of a row: two bytes a number in ASCII, empty lists in binary."""
        if not order:
            return max(1, 2 * len(self.properties))
        return sum(int((item.count_type or item.type)[1]) for item in self.properties)


@dataclass(slots=True)
class PlyHeader:
    """The parsed header."""

    order: Order
    """Byte order; empty for ASCII."""
    elements: list[PlyElement]
    """Elements in the order of their data."""
    size: int
    """Bytes of the header."""
    lines: int
    """Lines of the header."""
    crs: str = ""
    """Comment that names a coordinate system, if there is one."""


def parse_header(head: bytes, limits: ReadLimits) -> PlyHeader:
    """Parse the header at the start of `head`.

    Raises
    ------
    CloudFileError
        The header is malformed or too long; the message names the line.
    """
    order: Order | None = None
    elements: list[PlyElement] = []
    crs = ""
    offset, line_end = 0, find_line_end(head)
    for number in range(1, limits.max_header_lines + 1):
        end = head.find(line_end, offset)
        if end < 0:
            raise _missing_end(head, number, limits)
        words = decode_line(head[offset:end]).split()
        words[:1] = [word.lower() for word in words[:1]]
        offset = end + 1
        match words:
            case ["ply"] if number == 1:
                pass
            case ["end_header"]:
                if order is None:
                    raise MalformedFileError(
                        f"line {number}: end_header without a format line before it"
                    )
                for element in elements:
                    if not element.properties and element.count:
                        raise MalformedFileError(
                            f"element {element.name[:40]!r} has rows but no properties"
                        )
                return PlyHeader(order, _with_usual_names(elements), offset, number, crs)
            case ["format", name, "1.0"] if name.lower() in _ORDERS and order is None:
                order = _ORDERS[name.lower()]
            case ["element", name, count] if count.isdecimal() and len(count) < 19:
                elements.append(PlyElement(name.lower(), int(count)))
            case ["property", *rest] if elements:
                _add_property(elements[-1], rest, number, limits)
            case [] | ["comment" | "obj_info", *_]:
                crs = crs or _find_crs(" ".join(words[1:]))
            case [word, *_] if word not in _KEYWORDS and number > 1:
                pass  # a comment without its keyword
            case _:
                raise MalformedFileError(
                    f"line {number}: {' '.join(words)[:60]!r} is not a valid line of a PLY header"
                )
    raise FileLimitError(f"no line 'end_header' in the first {limits.max_header_lines} lines")


def _find_crs(comment: str) -> str:
    """Return a comment that names a coordinate system; nothing for others."""
    return comment[:_MAX_CRS] if _CRS.search(comment) else ""


def _with_usual_names(elements: list[PlyElement]) -> list[PlyElement]:
    """Call the only element with coordinates "vertex", and these x, y and z."""
    found = [element for element in elements if element.name == "vertex"] or elements
    for element in found:
        element.properties = _with_usual_axes(element.properties)
    if found is elements:
        found = [e for e in elements if set("xyz") <= {item.name for item in e.properties}]
        if len(found) == 1:
            found[0].name = "vertex"
    return elements


def _with_usual_axes(properties: list[PlyProperty]) -> list[PlyProperty]:
    """Call the numbers x, y and z that have other names of coordinates, as px, X or easting."""
    numbers = [item.name for item in properties if not item.count_type]
    places = find_xyz(numbers)
    if set("xyz") & {item.name for item in properties} or places is None:
        return properties
    axes = {numbers[place]: axis for place, axis in zip(places, "xyz", strict=True)}
    return [replace(item, name=axes.get(item.name, item.name)) for item in properties]


def _missing_end(
    head: bytes, number: int, limits: ReadLimits
) -> FileLimitError | TruncatedFileError:
    if len(head) >= limits.max_header_bytes:
        return FileLimitError(f"no line 'end_header' in the first {limits.max_header_bytes} bytes")
    return TruncatedFileError(f"line {number}: the file ends within the PLY header")


def _add_property(element: PlyElement, words: list[str], number: int, limits: ReadLimits) -> None:
    match words:
        case [kind, name] if kind.lower() in _TYPES:
            new = PlyProperty(name, _TYPES[kind.lower()])
        case ["list", length, kind, name] if _TYPES.get(length, "f")[0] in "iu" and kind in _TYPES:
            new = PlyProperty(name, _TYPES[kind], _TYPES[length])
        case _:
            raise MalformedFileError(
                f"line {number}: 'property {' '.join(words)[:60]}' is not valid; expected "
                "a type and a name, or a list with two types and a name"
            )
    if any(new.name == other.name for other in element.properties):
        raise MalformedFileError(f"line {number}: the property {new.name[:40]!r} is repeated")
    if len(element.properties) >= limits.max_properties:
        raise FileLimitError(f"line {number}: more than {limits.max_properties} properties")
    element.properties.append(new)
