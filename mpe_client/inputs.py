"""The clouds of a submission: paths, open files, arrays, URLs, stored clouds."""

from __future__ import annotations

import io
import os
import shutil
import tempfile
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from mpe_client.models import Cloud

URL_PREFIXES = ("http://", "https://", "s3://")
SPOOL_BYTES = 16 << 20
"""Bytes of a file that cannot be rewound which are kept in memory; more go to a temporary file."""


@dataclass(frozen=True, slots=True)
class StoredCloud:
    """A cloud that the service has, by its id."""

    id: str


PathText = str | os.PathLike[str]
CloudSource = str | os.PathLike[str] | BinaryIO | StoredCloud | Cloud | Any
"""A path, a URL (http, https, s3), a file of bytes, a stored cloud, or an array (N, 3).

A text is a URL if it begins with one of URL_PREFIXES, else a path."""


@dataclass(frozen=True, slots=True)
class LocalFile:
    """Bytes to upload, from the place of the file at which they begin."""

    file: BinaryIO
    name: str
    start: int
    size: int

    def rewind(self) -> BinaryIO:
        """Return the file at the beginning of the bytes."""
        self.file.seek(self.start)
        return self.file


Reference = dict[str, str]
"""A cloud that the service has or fetches: {"cloud": id} or {"url": address}."""


def open_cloud(cloud: CloudSource, stack: ExitStack) -> LocalFile | Reference:
    """Open what is to be uploaded, or say where the service finds the cloud.

    Parameters
    ----------
    cloud
        One of the kinds of `CloudSource`.
    stack
        Closes what is opened here; a file object of the caller stays open.

    Raises
    ------
    TypeError
        It is none of these kinds.
    OSError
        The file cannot be opened.
    """
    if isinstance(cloud, StoredCloud | Cloud):
        return {"cloud": cloud.id}
    if isinstance(cloud, str) and cloud.lower().startswith(URL_PREFIXES):
        return {"url": cloud}
    if isinstance(cloud, str | os.PathLike):
        path = Path(cloud)
        return _measure(stack.enter_context(path.open("rb")), path.name)
    if isinstance(cloud, io.TextIOBase):
        raise TypeError("expected a file opened for reading bytes, got text: open it with 'rb'")
    if hasattr(cloud, "read"):
        return _open_file(cloud, stack)
    return _encode_array(cloud)


def _open_file(file: BinaryIO, stack: ExitStack) -> LocalFile:
    name = Path(str(getattr(file, "name", "cloud"))).name
    if file.seekable():
        return _measure(file, name)
    spool = tempfile.SpooledTemporaryFile(SPOOL_BYTES)  # noqa: SIM115
    stack.callback(spool.close)
    shutil.copyfileobj(file, spool)
    spool.seek(0)
    return _measure(spool, name)  # type: ignore[arg-type]


def _measure(file: BinaryIO, name: str) -> LocalFile:
    start = file.tell()
    size = file.seek(0, os.SEEK_END) - start
    return LocalFile(file, name, start, size)


def _encode_array(points: Any) -> LocalFile:
    """Return points as a NumPy file."""
    import numpy as np  # for arrays alone

    array = np.asarray(points)
    if array.dtype.kind not in "fiu" or array.ndim != 2 or array.shape[1] != 3:
        raise TypeError(
            "expected a path, a URL, an open file, a StoredCloud or an array (N, 3) of numbers, "
            f"got {type(points).__name__} of shape {array.shape} and type {array.dtype}"
        )
    file = io.BytesIO()
    np.save(file, array, allow_pickle=False)
    file.seek(0)
    return _measure(file, "cloud.npy")
