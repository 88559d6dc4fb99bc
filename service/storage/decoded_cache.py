"""Cache of decoded clouds, so that a stored cloud is decoded once."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from service.formats.decoded_cloud import DecodedCloud, ReadLimits
from service.formats.disk import leaves_room
from service.formats.las_metadata import LasRecord
from service.storage.plain_file import is_plain_file

_MISS = (OSError, KeyError)  # KeyError: an entry in the layout of an earlier build
DIRECTORY = "prepared"
_BRIGHTNESS = "brightness_"


def decoded_path(data_dir: Path, tenant: str, sha256: str) -> Path:
    """Return the path of the entry for a tenant's cloud, whether it exists or not."""
    return data_dir / DIRECTORY / f"{sha256}-{tenant}-{version('mpe')}.npz"


def load_or_decode(
    entry: Path, decode: Callable[[], DecodedCloud], scratch: Path, limits: ReadLimits
) -> DecodedCloud:
    """Return the cached cloud, or decode it and leave a new entry in the scratch folder.

    Parameters
    ----------
    entry : Path
        Path of the entry, see `decoded_path`.
    decode : callable
        Returns the cloud when it is not cached; points, rows, brightness, format, warnings,
        viewpoints and coordinate system are kept.
    scratch : Path
        Folder for the new entry, which has the same file name; see `DecodedCache.adopt`.
    limits : ReadLimits
        Points that the memory holds: an entry that was made under another limit is not used if it
        has more, or was thinned. No entry is made that leaves too little of the disk.
    """
    with suppress(*_MISS), np.load(entry, allow_pickle=False) as arrays:
        header = json.loads(str(arrays["header"]))
        fits = header["count"] <= limits.max_points
        if fits if "rows" not in arrays else header["max_points"] == limits.max_points:
            return DecodedCloud(
                arrays["points"],
                header["format"],
                tuple(header["warnings"]),
                viewpoints=tuple(map(tuple, header["viewpoints"])),
                rows=arrays.get("rows"),
                brightness={
                    name.removeprefix(_BRIGHTNESS): arrays[name]
                    for name in arrays
                    if name.startswith(_BRIGHTNESS)
                },
                crs=tuple(
                    LasRecord(user, kind, text, bytes.fromhex(data))
                    for user, kind, text, data in header["crs"]
                ),
            )
    cloud = decode()
    records = [(r.user_id, r.record_id, r.description, r.data.hex()) for r in cloud.crs]
    header = {"format": cloud.format, "warnings": cloud.warnings, "crs": records}
    header |= {"count": len(cloud.points), "max_points": limits.max_points}
    header |= {"viewpoints": cloud.viewpoints}
    columns: dict[str, Any] = {"points": cloud.points}
    columns |= {} if cloud.rows is None else {"rows": cloud.rows}
    columns |= {_BRIGHTNESS + kind: values for kind, values in cloud.brightness.items()}
    if leaves_room(scratch, sum(values.nbytes for values in columns.values()), limits):
        with (scratch / entry.name).open("wb") as file:
            np.savez(file, header=np.array(json.dumps(header)), **columns)
    return cloud


class DecodedCache:
    """Files named by the hash of the content, the tenant, and the release that decoded them.

    Tenants share no entry: the time that decoding takes must not reveal what another tenant stored.
    """

    def __init__(self, data_dir: Path) -> None:
        self._data_dir = data_dir
        self._directory = data_dir / DIRECTORY
        self._directory.mkdir(exist_ok=True)

    def adopt(self, tenant: str, sha256: str, scratch: Path) -> None:
        """Move the new entry for a cloud, if there is one, from the scratch folder to the cache."""
        final = decoded_path(self._data_dir, tenant, sha256)
        if is_plain_file(scratch / final.name):
            self._directory.mkdir(exist_ok=True)  # the operator may have removed it
            (scratch / final.name).replace(final)

    def collect(self, needed: set[tuple[str, str]]) -> None:
        """Remove the entries whose (tenant, content hash) is not needed."""
        names = {f"{sha256}-{tenant}" for tenant, sha256 in needed}
        for path in self._directory.glob("*"):  # nothing, where it is missing
            if path.name.rpartition("-")[0] not in names:
                path.unlink(missing_ok=True)
