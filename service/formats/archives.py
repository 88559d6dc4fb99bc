"""gzip and zip files around one cloud file, expanded within a bound."""

from __future__ import annotations

import errno
import gzip
import shutil
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from service.formats.decoded_cloud import ReadLimits
from service.formats.errors import (
    CloudFileError,
    FileLimitError,
    MalformedFileError,
    UnsupportedFileError,
    short_reason,
)
from service.formats.foreign import foreign_by_name

GZIP_MAGIC, ZIP_MAGIC = b"\x1f\x8b", b"PK\x03\x04"
_BLOCK_BYTES = 1 << 20
_MIN_ALLOWED_BYTES = 1 << 20
"""Expanded bytes that are allowed whatever the ratio; ratios of small files say nothing."""
_CLUTTER = (".DS_Store", "Thumbs.db", "desktop.ini")
_SIDECARS = (".mtl", ".png", ".jpg", ".jpeg", ".prj", ".pdf", ".md", ".json", ".xml")
"""Extensions of files that may accompany a cloud; JSON and XML are never its only file."""
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
def expand_archive(path: Path, limits: ReadLimits) -> Iterator[Path]:
    """Expand the only file of a gzip or zip archive into a temporary file.

    Names inside the archive are never used as paths.

    Raises
    ------
    CloudFileError
        The archive is damaged, expands too far, or does not hold exactly one file. Its context is
        an OSError with ENOSPC where too little of the disk would be left.
    """
    with path.open("rb") as file, tempfile.TemporaryDirectory(prefix="unwrapped-") as folder:
        inner = Path(folder) / "cloud"
        allowed = max(_MIN_ALLOWED_BYTES, limits.max_expansion * path.stat().st_size)
        try:
            if file.read(2) == GZIP_MAGIC:
                with gzip.open(path) as content:
                    _expand(content, inner, allowed, limits)
            else:
                with zipfile.ZipFile(path) as archive, archive.open(_only_file(archive)) as content:
                    _expand(content, inner, allowed, limits)
        except CloudFileError:
            raise
        except _ERRORS as error:
            reason = short_reason(error)
            raise MalformedFileError(f"the archive cannot be expanded: {reason}") from None
        yield inner


def is_single_file_zip(path: Path) -> bool:
    """Whether a zip file is no .npz: no member is a NumPy array."""
    try:
        with zipfile.ZipFile(path) as archive:
            return not any(name.endswith(".npy") for name in archive.namelist())
    except _ERRORS:
        return True  # expand_archive reports the reason


def _only_file(archive: zipfile.ZipFile) -> zipfile.ZipInfo:
    files = [info for info in archive.infolist() if not (info.is_dir() or _is_clutter(info))]
    clouds = [info for info in files if not info.filename.lower().endswith(_SIDECARS)]
    if len(clouds) != 1:
        named = next(filter(None, (foreign_by_name(info.filename) for info in clouds)), None)
        names = ", ".join(repr(info.filename[-60:]) for info in (clouds or files)[:9])
        raise UnsupportedFileError(
            f"the zip archive holds {len(files)} files ({names}); expected one cloud file"
            + (f"; {named}" if named else "")
        )
    return clouds[0]


def _is_clutter(info: zipfile.ZipInfo) -> bool:
    """Whether an operating system added the file."""
    parts = info.filename.split("/")
    return "__MACOSX" in parts or parts[-1].startswith("._") or parts[-1] in _CLUTTER


def _expand(
    content: IO[bytes] | gzip.GzipFile, target: Path, allowed: int, limits: ReadLimits
) -> None:
    written = 0
    with target.open("wb") as file:
        while block := content.read(_BLOCK_BYTES):
            written += len(block)
            if written > allowed:
                raise FileLimitError(
                    f"the archive expands to more than {allowed} bytes; send the file uncompressed"
                )
            if shutil.disk_usage(target.parent).free - len(block) < limits.min_free_disk_bytes:
                raise OSError(errno.ENOSPC, "too little of the disk would be left")
            file.write(block)
