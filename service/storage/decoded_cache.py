"""Cache of decoded clouds, so that a stored cloud is decoded once."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path

import numpy as np

from service.formats.decoded_cloud import DecodedCloud

_MISS = (FileNotFoundError, KeyError)  # KeyError: an entry in the layout of an earlier build


class DecodedCache:
    """Files named by the hash of the content, the tenant, and the release that decoded them.

    Tenants share no entry: the time that decoding takes must not reveal what another tenant stored.
    """

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        directory.mkdir(exist_ok=True)

    def get_or_decode(
        self, tenant: str, sha256: str, decode: Callable[[], DecodedCloud], scratch: Path
    ) -> DecodedCloud:
        """Return the cached cloud, or decode and cache it.

        Parameters
        ----------
        tenant, sha256 : str
            Owner and content hash of the cloud.
        decode : callable
            Returns the cloud when it is not cached; only points, format and warnings are kept.
        scratch : Path
            Folder for the unfinished file, in the same file system as the cache.
        """
        path = self._directory / f"{sha256}-{tenant}-{version('mpe')}.npz"
        with suppress(*_MISS), np.load(path, allow_pickle=False) as entry:
            header = json.loads(str(entry["header"]))
            return DecodedCloud(entry["points"], header["format"], tuple(header["warnings"]))
        cloud = decode()
        header = json.dumps({"format": cloud.format, "warnings": cloud.warnings})
        with (scratch / path.name).open("wb") as file:
            np.savez(file, points=cloud.points, header=np.array(header))
        (scratch / path.name).replace(path)
        return cloud

    def collect(self, needed: set[tuple[str, str]]) -> None:
        """Remove the entries whose (tenant, content hash) is not needed."""
        names = {f"{sha256}-{tenant}" for tenant, sha256 in needed}
        for path in self._directory.iterdir():
            if path.name.rpartition("-")[0] not in names:
                path.unlink(missing_ok=True)
