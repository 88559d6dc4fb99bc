"""Types of columns: as a file declares them, unless the numbers do not fit."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def restore_type(column: NDArray[Any], kind: str) -> NDArray[np.generic]:
    """Return the column in the declared type, or as it is where integers would wrap."""
    wanted = np.dtype(kind)
    if wanted.kind == "f" or column.dtype.kind != "f":
        with np.errstate(over="ignore"):
            return column.astype(wanted)
    bounds = np.iinfo(wanted)
    is_whole = np.isfinite(column) & (column == np.rint(column))
    fits = is_whole & (column >= bounds.min) & (column <= bounds.max)
    return column.astype(wanted) if fits.all() else column
