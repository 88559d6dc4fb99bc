"""Writer of NumPy arrays."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from service.formats.writers.outgoing import Outgoing, to_rows


def write(path: Path, cloud: Outgoing) -> None:
    """Write an (N, 3) array; with attributes a structured one with the fields x, y, z, ..."""
    cloud.drop_faces()
    array = to_rows(cloud.points, cloud.columns) if cloud.columns else cloud.points
    with path.open("wb") as file:
        np.save(file, array, allow_pickle=False)
