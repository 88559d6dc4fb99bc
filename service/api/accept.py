"""Choice of a media type by the Accept header (RFC 9110, 12.5.1)."""

from __future__ import annotations

import re
from collections.abc import Sequence

_QUALITY = re.compile(r"\s*q\s*=\s*([01](?:\.\d{0,3})?)\s*", re.IGNORECASE)


def preferred_type(accept: str, offered: Sequence[str]) -> str | None:
    """Return the offered media type that the header prefers; None if it excludes all.

    Parameters
    ----------
    accept : str
        Value of the Accept header; empty: everything.
    offered : sequence of str
        Media types in lower case; of equally welcome ones the first is chosen, but one that is
        named goes before one that a wildcard covers.
    """
    ranges = dict(map(_parse_range, (accept or "*/*").lower().split(",")))

    def rank(kind: str) -> tuple[float, int]:
        for specificity, pattern in enumerate((kind, f"{kind.partition('/')[0]}/*", "*/*")):
            if pattern in ranges:
                return ranges[pattern], -specificity
        return 0.0, 0

    best = max(offered, key=rank)
    return best if rank(best)[0] > 0 else None


def _parse_range(text: str) -> tuple[str, float]:
    kind, *parameters = text.split(";")
    qualities = (match for item in parameters if (match := _QUALITY.fullmatch(item)))
    first = next(qualities, None)
    return kind.strip(), 1.0 if first is None else float(first[1])
