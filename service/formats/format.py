"""What a readable format is: how its files are recognised, read, and what is kept of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from service.formats.decoded_cloud import DecodedCloud

ReadChoice = Literal["scan", "faces", "attributes", "weights", "columns", "array"]
"""Keyword arguments of `read_points` that only some formats know."""


def _never(_: Any) -> bool:
    return False


@dataclass(frozen=True, slots=True)
class Format:
    """A file format: how it is recognised and read."""

    name: str
    """Name in requests and results."""
    title: str
    """One line for users: the dialects that are read."""
    kept: str
    """What is kept beside the coordinates where attributes are requested; for users."""
    extensions: tuple[str, ...]
    """Usual file extensions; for information only."""
    sniff: Callable[[bytes], bool] | None
    """Whether the first bytes of a file match; None: read only if declared."""
    read: Callable[..., DecodedCloud] | None
    """Takes the path, the limits, and the choices as keywords; None: always an archive."""
    choices: tuple[ReadChoice, ...] = ()
    """Keyword arguments that `read` takes."""
    is_archive: Callable[[Path], bool] = _never
    """Whether a file is an archive around another cloud file, which is read instead."""
    read_pieces: Callable[..., Iterator[DecodedCloud]] | None = None
    """As `read`, but yields consecutive parts of bounded size; None: files are read whole."""
