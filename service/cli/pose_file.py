"""A pose that a person has in a file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from mpe_core import InvalidOptionsError


def read_pose(path: Path) -> Any:
    """4x4 numbers: four lines of four, or JSON, alone or as the `transform` of a result.

    Raises
    ------
    InvalidOptionsError
        The file has no such numbers.
    """
    try:
        text = path.read_text()
        found = _json(text) if text.lstrip().startswith(("{", "[")) else _rows(text)
    except (ValueError, RecursionError):
        found = None
    if found is None:
        raise InvalidOptionsError(
            f"{path}: expected four lines of four numbers, or JSON with them as 'transform'"
        )
    return found


def _json(text: str) -> Any:
    found = json.loads(text)
    return found.get("transform") if isinstance(found, dict) else found


def _rows(text: str) -> list[list[float]]:
    lines = text.replace(",", " ").splitlines()
    return [[float(word) for word in line.split()] for line in lines if line.strip()]
