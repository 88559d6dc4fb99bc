"""gzip and zip files around one cloud file, expanded within a bound."""

from __future__ import annotations

import gzip
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from service.formats.decoded_cloud import ReadLimits
from service.formats.disk import check_disk
from service.formats.errors import (
    CloudFileError,
    FileLimitError,
    MalformedFileError,
    UnsupportedFileError,
    short_reason,
)
from service.formats.foreign_suffixes import foreign_by_name

GZIP_MAGIC, ZIP_MAGIC = b"\x1f\x8b", b"PK\x03\x04"
_BLOCK_BYTES = 1 << 20
_MIN_ALLOWED_BYTES = 1 << 20
"""Expanded bytes that are allowed whatever the ratio; ratios of small files say nothing."""
_CLUTTER = (".DS_Store", "Thumbs.db", "desktop.ini")
_SIDECARS = (".mtl", ".png", ".jpg", ".jpeg", ".prj", ".pdf", ".md", ".json", ".xml")
"""Extensions of files that may accompany a cloud; JSON and XML are never its only file."""
_ABOUT = ("readme", "read_me", "license", "licence", "copying", "changelog")
"""Beginnings of the names of files that tell about others."""
_PACKAGES = {
    "xl/workbook.xml": "an Excel workbook, which is not read: save the sheet as CSV",
    "word/document.xml": "a Word document, which is not read: send a point cloud",
    "3dmodel.model": "a 3MF model, which is not read: export it as STL, OBJ or PLY",
    "/data.pkl": "a PyTorch file, which is not read: save the points as .npy",
    "3dSceneLayer.json.gz": "an I3S scene (.slpk), which is not read: export it as LAS",
    "doc.kml": "a KMZ file, which is not read: export its points in metres as lines of x y z",
}
"""Archives that are documents: the end of the name of a member, what it is, and what to do."""
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
    if (package := _package_of(archive)) is not None:
        raise UnsupportedFileError(f"the zip archive is {package}")
    if len(clouds) != 1:
        named = next(filter(None, (foreign_by_name(info.filename) for info in clouds)), None)
        names = ", ".join(repr(info.filename[-60:]) for info in (clouds or files)[:9])
        raise UnsupportedFileError(
            f"the zip archive holds {len(files)} files ({names}); expected one cloud file"
            + (f"; {named}" if named else "")
        )
    return clouds[0]


def _package_of(archive: zipfile.ZipFile) -> str | None:
    """Describe an archive that is a document of its own; None if it is none."""
    names = archive.namelist()
    return next(
        (text for end, text in _PACKAGES.items() if any(name.endswith(end) for name in names)), None
    )


def _is_clutter(info: zipfile.ZipInfo) -> bool:
    """Whether an operating system added the file, or it tells about the others."""
    parts = info.filename.split("/")
    is_about = parts[-1].lower().startswith(_ABOUT)
    return "__MACOSX" in parts or parts[-1].startswith("._") or parts[-1] in _CLUTTER or is_about


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
            check_disk(target.parent, len(block), limits)
            file.write(block)
