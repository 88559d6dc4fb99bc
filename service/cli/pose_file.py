"""Reading a pose from a text file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from mpe_core import InvalidOptionsError


def read_pose(path: Path) -> Any:
    """Read a transform: lines of numbers, or JSON, alone or as the `transform` of a result.

    The shape and the values are not checked.

    Raises
    ------
    InvalidOptionsError
        The file does not have that form.
    """
    try:
        text = path.read_text()
        pose = _json(text) if text.lstrip().startswith(("{", "[")) else _rows(text)
    except (ValueError, RecursionError):
        pose = None
    if pose is None:
        raise InvalidOptionsError(
            f"{path}: expected three or four lines of four numbers, one of 12 or 16, or JSON with"
            " them as 'transform'"
        )
    return pose


def _json(text: str) -> Any:
    document = json.loads(text)
    return document.get("transform", document) if isinstance(document, dict) else document


def _rows(text: str) -> list[float] | list[list[float]]:
    lines = text.replace(",", " ").splitlines()
    rows = [[float(word) for word in line.split()] for line in lines if line.strip()]
    return rows[0] if len(rows) == 1 else rows
