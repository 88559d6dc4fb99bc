"""The header of a PLY file: which elements follow, and what their rows are made of."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from service.formats.decoded_cloud import Limits
from service.formats.errors import FileLimitError, MalformedFileError, TruncatedFileError

Order = Literal["", "<", ">"]
_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1",
    "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2",
    "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
_ORDERS: dict[str, Order] = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass(frozen=True, slots=True)
class Property:
    name: str
    type: str  # NumPy's code without byte order: "f4"
    count_type: str | None = None  # of a list's length; None: not a list


@dataclass(slots=True)
class Element:
    name: str
    count: int
    properties: list[Property] = field(default_factory=list)

    @property
    def has_lists(self) -> bool:
        return any(item.count_type for item in self.properties)

    def smallest_row(self, order: Order) -> int:
        """Bytes that a row takes at least: two a number in ASCII, empty lists in binary."""
        if not order:
            return max(1, 2 * len(self.properties))
        return sum(int((item.count_type or item.type)[1]) for item in self.properties)


@dataclass(slots=True)
class Header:
    order: Order  # "" for ASCII
    elements: list[Element]
    size: int  # bytes
    lines: int


def parse_header(head: bytes, limits: Limits) -> Header:
    """Parse the header at the start of ``head``.

    Raises
    ------
    CloudFileError
        With the line at fault.
    """
    order: Order | None = None
    elements: list[Element] = []
    offset = 0
    for number in range(1, limits.max_header_lines + 1):
        end = head.find(b"\n", offset)
        if end < 0:
            raise _no_end(head, number, limits)
        words = head[offset:end].decode("latin1").split()
        offset = end + 1
        match words:
            case ["ply"] if number == 1:
                pass
            case ["end_header"]:
                if order is None:
                    raise MalformedFileError(f"line {number}: no format line before end_header")
                for element in elements:
                    if not element.properties:
                        raise MalformedFileError(f"element {element.name[:40]!r} has no properties")
                return Header(order, elements, offset, number)
            case ["format", name, "1.0"] if name in _ORDERS and order is None:
                order = _ORDERS[name]
            case ["element", name, count] if count.isdecimal() and len(count) < 19:
                elements.append(Element(name, int(count)))
            case ["property", *rest] if elements:
                _add_property(elements[-1], rest, number, limits)
            case [] | ["comment" | "obj_info", *_]:
                pass
            case _:
                raise MalformedFileError(f"line {number}: {' '.join(words)[:60]!r} in a PLY header")
    raise FileLimitError(f"no end_header in the first {limits.max_header_lines} lines")


def _no_end(head: bytes, number: int, limits: Limits) -> FileLimitError | TruncatedFileError:
    if len(head) >= limits.max_header_bytes:
        return FileLimitError(f"no end_header in the first {limits.max_header_bytes} bytes")
    return TruncatedFileError(f"line {number}: the file ends within the PLY header")


def _add_property(element: Element, words: list[str], number: int, limits: Limits) -> None:
    match words:
        case [kind, name] if kind in _TYPES:
            new = Property(name, _TYPES[kind])
        case ["list", length, kind, name] if _TYPES.get(length, "f")[0] in "iu" and kind in _TYPES:
            new = Property(name, _TYPES[kind], _TYPES[length])
        case _:
            raise MalformedFileError(
                f"line {number}: 'property {' '.join(words)[:60]}' in a PLY header"
            )
    if any(new.name == other.name for other in element.properties):
        raise MalformedFileError(f"line {number}: a second property {new.name[:40]!r}")
    if len(element.properties) >= limits.max_properties:
        raise FileLimitError(f"line {number}: more than {limits.max_properties} properties")
    element.properties.append(new)
