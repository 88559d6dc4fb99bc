"""Decoding of file contents that tests make in memory."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import laspy  # noqa: F401  loaded before memory is measured
import pye57  # noqa: F401
import pytest
import trimesh  # noqa: F401

from mpe_core.kernels import lzf  # noqa: F401
from service.formats import CloudFileError, DecodedCloud, MalformedFileError, read_points

MAX_MEMORY = 8 << 20
"""Bytes that decoding a file of a few kilobytes may take."""


def write_file(folder: Path, content: bytes) -> Path:
    """Write the content under a name that tells nothing of its format."""
    path = folder / "cloud"
    path.write_bytes(content)
    return path


def decode(folder: Path, content: bytes) -> DecodedCloud:
    """Decode the content."""
    return read_points(write_file(folder, content))


def reason_of_refusal(folder: Path, content: bytes) -> str:
    """Return what is said of a malformed content, which must be refused."""
    with pytest.raises(MalformedFileError) as caught:
        decode(folder, content)
    return str(caught.value)


def decode_frugally(folder: Path, content: bytes, **choices: int) -> DecodedCloud | CloudFileError:
    """Decode with little memory; any exception other than CloudFileError fails the test."""
    path = write_file(folder, content)
    tracemalloc.start()
    try:
        return read_points(path, **choices)
    except CloudFileError as error:
        return error
    finally:
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < MAX_MEMORY + 16 * len(content)
