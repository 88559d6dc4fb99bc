"""Import of the libraries that only some formats need."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from service.formats.errors import MissingLibraryError

LIBRARIES = ("DracoPy", "h5py", "laspy", "pye57", "trimesh")
"""Modules that `import_library` imports; the service loads all of them before a file is read."""


def import_library(name: str) -> Any:
    """Import the module `name`, one of LIBRARIES.

    Raises
    ------
    MissingLibraryError
        It is not installed; the message names the extra that installs it.
    """
    assert name in LIBRARIES  # noqa: S101
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        if error.name is None or error.name.split(".")[0] != name.split(".")[0]:
            raise
        raise MissingLibraryError(
            f"this format needs the Python package {name!r}, which is not installed; "
            "install the formats' libraries with: pip install 'mpe[service]'"
        ) from None
