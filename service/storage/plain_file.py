"""Files that a process of lesser trust has left: opened without following links."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import BinaryIO


class NotPlainFileError(OSError):
    """The path is no regular file with a single name."""


def open_plain_file(path: Path) -> BinaryIO:
    """Open a regular file for reading.

    Raises
    ------
    NotPlainFileError
        It is missing, a link, or something that is not a file, or it has a second name.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as error:
        raise NotPlainFileError(f"{path.name} cannot be opened") from error
    found = os.fstat(descriptor)
    if not stat.S_ISREG(found.st_mode) or found.st_nlink != 1:
        os.close(descriptor)
        raise NotPlainFileError(f"{path.name} is no regular file")
    return os.fdopen(descriptor, "rb")


def is_plain_file(path: Path) -> bool:
    """Return whether `open_plain_file` would open the path."""
    try:
        open_plain_file(path).close()
    except NotPlainFileError:
        return False
    return True
