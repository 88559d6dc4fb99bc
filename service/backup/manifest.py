"""List of the files of a backup, with the hash of each; a backup without it is not complete."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError

NAME = "manifest.json"
_BLOCK_BYTES = 1 << 20


class BackupError(RuntimeError):
    """A backup cannot be made, is not whole, or cannot be restored; the text says why."""


class BackedUpFile(BaseModel):
    """A file of a backup."""

    model_config = ConfigDict(frozen=True)
    path: str = Field(pattern=r"^[A-Za-z0-9_.-]+(/[A-Za-z0-9_-]+)*$")
    """Path in the data directory and in the backup."""
    size: int
    sha256: str


class Manifest(BaseModel):
    """What a backup holds."""

    model_config = ConfigDict(frozen=True)
    release: str
    """Version of mpe that made the backup."""
    created_at: float
    """Seconds since the epoch, UTC."""
    files: list[BackedUpFile]
    missing: list[str] = []
    """Files that the store names and the data directory did not have."""

    @classmethod
    def read(cls, directory: Path) -> Self:
        """Read the manifest of a backup.

        Raises
        ------
        BackupError
            There is none, or it is damaged.
        """
        try:
            return cls.model_validate_json((directory / NAME).read_bytes())
        except FileNotFoundError:
            raise BackupError(f"{directory} is no complete backup: {NAME} is missing") from None
        except (ValidationError, OSError) as error:
            raise BackupError(f"{directory / NAME} cannot be read: {error}") from error

    def write(self, directory: Path) -> None:
        """Write the manifest, which completes the backup."""
        write_durably(directory / NAME, self.model_dump_json(indent=1).encode())


def copy_file(source: Path, target: Path, name: str) -> BackedUpFile:
    """Copy a file durably, as far as it reaches now, and describe the copy.

    Raises
    ------
    FileNotFoundError
        There is no source.
    """
    with source.open("rb") as reader:
        target.parent.mkdir(parents=True, exist_ok=True)
        digest, size = hashlib.sha256(), 0
        with target.open("wb") as writer:
            while block := reader.read(_BLOCK_BYTES):
                digest.update(block)
                size += len(block)
                writer.write(block)
            writer.flush()
            os.fsync(writer.fileno())
    return BackedUpFile(path=name, size=size, sha256=digest.hexdigest())


def hash_file(path: Path) -> str:
    """Return the SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def write_durably(path: Path, content: bytes) -> None:
    """Write a file and wait for the disk."""
    with path.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def sync_directory(directory: Path) -> None:
    """Wait until the names in a directory are on the disk."""
    descriptor = os.open(directory, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
