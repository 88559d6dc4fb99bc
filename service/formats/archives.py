"""gzip and zip around one cloud file, expanded with a bound."""

from __future__ import annotations

import gzip
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from service.formats.decoded_cloud import Limits
from service.formats.errors import (
    CloudFileError,
    FileLimitError,
    MalformedFileError,
    UnsupportedFileError,
)

GZIP_MAGIC, ZIP_MAGIC = b"\x1f\x8b", b"PK\x03\x04"
_BLOCK = 1 << 20
_FREE_BYTES = 1 << 20  # may be expanded whatever the ratio
_ERRORS = (
    zipfile.BadZipFile,
    zlib.error,
    EOFError,
    OSError,
    RuntimeError,
    NotImplementedError,
    ValueError,
    KeyError,
    IndexError,
)


@contextmanager
def unwrapped(path: Path, limits: Limits) -> Iterator[Path]:
    """Give a temporary file with what the gzip or zip file wraps.

    Names inside the archive are never used as paths.

    Raises
    ------
    CloudFileError
        The archive is damaged, expands too far, or holds not exactly one file.
    """
    with path.open("rb") as file, tempfile.TemporaryDirectory(prefix="unwrapped-") as folder:
        inner = Path(folder) / "cloud"
        allowed = max(_FREE_BYTES, limits.max_expansion * path.stat().st_size)
        try:
            if file.read(2) == GZIP_MAGIC:
                with gzip.open(path) as content:
                    _expand(content, inner, allowed)
            else:
                with zipfile.ZipFile(path) as archive, archive.open(_only_file(archive)) as content:
                    _expand(content, inner, allowed)
        except CloudFileError:
            raise
        except _ERRORS as error:
            reason = str(error).splitlines()[0][:200] if str(error) else type(error).__name__
            raise MalformedFileError(f"the archive cannot be expanded: {reason}") from None
        yield inner


def zips_one_file(path: Path) -> bool:
    """Whether the zip file is no .npz: no member is a NumPy array."""
    try:
        with zipfile.ZipFile(path) as archive:
            return not any(name.endswith(".npy") for name in archive.namelist())
    except _ERRORS:
        return True  # expanding it says what is wrong


def _only_file(archive: zipfile.ZipFile) -> zipfile.ZipInfo:
    files = [info for info in archive.infolist() if not info.is_dir()]
    if len(files) != 1:
        raise UnsupportedFileError(f"a zip of {len(files)} files; one cloud file is expected")
    return files[0]


def _expand(content: IO[bytes] | gzip.GzipFile, target: Path, allowed: int) -> None:
    written = 0
    with target.open("wb") as file:
        while block := content.read(_BLOCK):
            written += len(block)
            if written > allowed:
                raise FileLimitError(f"expands to more than {allowed} bytes")
            file.write(block)
