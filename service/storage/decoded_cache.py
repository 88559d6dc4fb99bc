"""Decoded clouds that registrations refer to, kept so that each is decoded once."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import numpy as np

from service.formats.decoded_cloud import DecodedCloud


class DecodedCache:
    """Files named by the content's hash, the tenant, and the release that decoded it.

    Each tenant has its own: how long decoding takes must not tell what somebody else has.
    """

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        directory.mkdir(exist_ok=True)

    def decoded(
        self, tenant: str, sha256: str, decode: Callable[[], DecodedCloud], scratch: Path
    ) -> DecodedCloud:
        """The tenant's cloud as it was decoded before, or as `decode` gives it now."""
        path = self._directory / f"{sha256}-{tenant}-{version('mpe')}.npz"
        with contextlib.suppress(FileNotFoundError), np.load(path, allow_pickle=False) as kept:
            said = json.loads(str(kept["said"]))
            return DecodedCloud(kept["points"], said["format"], tuple(said["warnings"]))
        cloud = decode()
        said = json.dumps({"format": cloud.format, "warnings": cloud.warnings})
        with (scratch / path.name).open("wb") as file:
            np.savez(file, points=cloud.points, said=np.array(said))
        (scratch / path.name).replace(path)
        return cloud

    def collect(self, needed: set[tuple[str, str]]) -> None:
        """Remove what was decoded of files that are not needed, given as (tenant, hash)."""
        names = {f"{sha256}-{tenant}" for tenant, sha256 in needed}
        for path in self._directory.iterdir():
            if path.name.rpartition("-")[0] not in names:
                path.unlink(missing_ok=True)
