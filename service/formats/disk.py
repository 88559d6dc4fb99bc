"""The disk that is left while a file is expanded."""

from __future__ import annotations

import errno
import shutil
from pathlib import Path

from service.formats.decoded_cloud import ReadLimits


def leaves_room(folder: Path, size: int, limits: ReadLimits) -> bool:
    """Return whether enough of the disk stays free when so many bytes are written there."""
    return shutil.disk_usage(folder).free - size >= limits.min_free_disk_bytes


def check_disk(folder: Path, size: int, limits: ReadLimits) -> None:
    """Check that enough of the disk stays free when so many bytes are written to a folder.

    Raises
    ------
    OSError
        With ENOSPC: less than `limits.min_free_disk_bytes` would be left.
    """
    if not leaves_room(folder, size, limits):
        raise OSError(errno.ENOSPC, "too little of the disk would be left")
