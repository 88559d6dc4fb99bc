"""A disk for the data that can be filled."""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

DISK_BYTES = 400 * 2**20
"""Size of the disk, where the system lets one be made."""
MIN_FREE_BYTES = 64 * 2**20
ROOM_BYTES = 2**31
"""Room above the least free space on a disk that is shared with others."""
BALLAST = "ballast"
FULL_S = 2.0


@dataclass(frozen=True, slots=True)
class Disk:
    """The disk that a directory is on."""

    directory: Path
    is_own: bool
    min_free_bytes: int
    """What the service is to leave free."""

    def fill(self) -> None:
        """Fill the disk for a while: to the last byte if it is our own, else below the least."""
        ballast = self.directory / BALLAST
        try:
            with suppress(OSError), ballast.open("wb") as file:
                if self.is_own:
                    while file.write(bytes(2**20)):
                        file.flush()
                free_bytes = shutil.disk_usage(self.directory).free
                os.posix_fallocate(
                    file.fileno(), 0, max(1, free_bytes - self.min_free_bytes + 2**20)
                )
            time.sleep(FULL_S)
        finally:
            ballast.unlink()


@contextmanager
def small_disk(directory: Path) -> Iterator[Disk]:
    """Make a disk of DISK_BYTES at the directory, or take the one that it is on."""
    directory.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", f"size={DISK_BYTES}", "tmpfs", str(directory)]
    if os.geteuid() or subprocess.run(command, check=False, capture_output=True).returncode:
        yield Disk(directory, False, max(0, shutil.disk_usage(directory).free - ROOM_BYTES))
        return
    try:
        yield Disk(directory, True, MIN_FREE_BYTES)
    finally:
        subprocess.run(["umount", "-l", str(directory)], check=True)
