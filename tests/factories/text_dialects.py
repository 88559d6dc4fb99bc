"""Random dialects of delimited text, as programs, spreadsheets and people write it."""

from __future__ import annotations

from dataclasses import dataclass
from random import Random

import numpy as np
from numpy.typing import NDArray

_NAMES = (
    ("x", "y", "z"),
    ("X", "Y", "Z"),
    ("x_m", "y_m", "z_m"),
    ("X [m]", "Y [m]", "Z [m]"),
    ("X(m)", "Y(m)", "Z(m)"),
    ("Easting", "Northing", "Elevation"),
    ("E", "N", "H"),
    ("Rechtswert", "Hochwert", "Höhe"),
    ("Points:0", "Points:1", "Points:2"),
    ("POINT_X", "POINT_Y", "POINT_Z"),
    ("pos_x", "pos_y", "pos_z"),
    ("X:3", "Y:3", "Z:3"),
    ("x:double", "y:double", "z:double"),
)
_OTHERS = ("id", "intensity", "time", "r", "class", "label", "ring", "gps_time")
_MISSING = ("NA", "nan", "NaN", "", "-1.#IND", "1.#QNAN", "-nan(ind)", "null")


@dataclass(frozen=True, slots=True)
class TextDialect:
    """A way to write a table of points."""

    names: tuple[str, ...] | None
    """Names of the coordinates; None: without a line of names."""
    order: tuple[int, ...]
    """Order of the columns: 0 to 2 are x, y, z, further ones are other attributes."""
    others: tuple[str, ...]
    delimiter: str
    decimal: str
    mark: str
    """Beginning of the line of names: "# ", "//", or nothing."""
    title: str
    """Lines before the names."""
    has_units: bool
    quote: str
    """Sign around each word, or nothing."""
    ends_rows: bool
    """Whether each line ends with a delimiter."""
    missing: str | None
    """Word for missing coordinates in some rows."""
    has_count: bool
    eol: str
    encoding: str
    numeral: str
    has_blank_lines: bool
    ends_with_eol: bool

    @classmethod
    def draw(cls, random: Random) -> TextDialect:
        """Draw a dialect; combinations that nobody can read are drawn too."""
        count = random.choice((0, 0, 0, 1, 2, 4))
        others = tuple(random.sample(_OTHERS, count))
        names = random.choice((None, *_NAMES))
        order = list(range(3 + count))
        if names is not None and random.random() < 0.5:
            random.shuffle(order)
        return cls(
            names,
            tuple(order),
            others,
            delimiter=random.choice((" ", "  ", "\t", ",", ", ", ";", "; ", "|")),
            decimal=random.choice((".", ".", ".", ",")),
            mark=random.choice(("", "", "", "# ", "#", "//", "% ")),
            title=random.choice(("", "", "", "made by hand{eol}", "# scan 7 of 12{eol}{eol}")),
            has_units=random.random() < 0.1,
            quote=random.choice(("'", '"')) if random.random() < 0.15 else "",
            ends_rows=random.random() < 0.1,
            missing=random.choice(_MISSING) if random.random() < 0.2 else None,
            has_count=random.random() < 0.1,
            eol=random.choice(("\n", "\n", "\n", "\r\n", "\r")),
            encoding=random.choice(("utf8", "utf8", "utf8", "utf-8-sig", "utf-16", "utf-16-le")),
            numeral=random.choice(("%.3f", "%.3f", "%+.3f", "%9.3f", "%.9e", "%.3E")),
            has_blank_lines=random.random() < 0.1,
            ends_with_eol=random.random() < 0.9,
        )

    @property
    def is_clear(self) -> bool:
        """Whether nothing in it leaves a doubt, so that it must be read."""
        is_plain = self.decimal == "." and self.missing is None and self.numeral != "%9.3f"
        names_fit = self.names is None or " " not in self.names[0] or self.delimiter.strip() != ""
        is_ordered = self.names is not None or not self.others
        return is_plain and names_fit and is_ordered and not self.has_units and not self.title

    def write(self, points: NDArray[np.float64]) -> bytes:
        """Return the bytes of a file of these points."""
        lines = [self.title.format(eol=self.eol).removesuffix(self.eol)] if self.title else []
        lines += [str(len(points))] if self.has_count else []
        if self.names is not None:
            lines.append(self.mark + self._join([*self.names, *self.others]))
            lines += [self._join(["m"] * 3 + ["-"] * len(self.others))] if self.has_units else []
        for row, point in enumerate(points):
            words = [self._numeral(value) for value in point]
            words += [str(row * 7 + column) for column in range(len(self.others))]
            lines.append(self._join(words))
            lines += [""] if self.has_blank_lines and row % 9 == 8 else []
        text = self.eol.join(lines) + (self.eol if self.ends_with_eol else "")
        return text.encode(self.encoding)

    def _numeral(self, value: float) -> str:
        if not np.isfinite(value):
            return self.missing or "nan"
        return (self.numeral % value).replace(".", self.decimal)

    def _join(self, words: list[str]) -> str:
        ordered = [words[column] for column in self.order]
        ordered = [self.quote + word + self.quote for word in ordered]
        return self.delimiter.join(ordered) + (self.delimiter if self.ends_rows else "")
