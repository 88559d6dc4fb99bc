"""What every method offers."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BUILT = Path(__file__).parent.parent.parent / "build"
"""Where `make peers` puts what the lock file does not hold."""

sys.path.append(str(BUILT / "peers"))


@dataclass(frozen=True)
class Method:
    """A registration method; `register` gives T_target_source for clouds (N, 3) and (M, 3)."""

    name: str
    version: str | None
    """Package and version; None: not installed."""
    register: Callable[[Array, Array], Array]
    settings: str
    """The settings it runs with, in words."""


def version_of(package: str) -> str | None:
    """Name and version of an installed package."""
    try:
        return f"{package} {version(package)}"
    except PackageNotFoundError:
        return None


def diagonal(cloud: Array) -> float:
    """Length of the diagonal of the bounding box."""
    return float(np.linalg.norm(np.ptp(cloud, axis=0)))


def centred_start(source: Array, target: Array) -> Array:
    """(4, 4) pose that lays the centroids on each other and turns nothing."""
    T = np.eye(4)
    T[:3, 3] = target.mean(axis=0) - source.mean(axis=0)
    return T


def rigid(R: Array, t: Array, source: Array, target: Array, unit: float) -> Array:
    """(4, 4) pose between the clouds for one between them centred and divided by the unit; R is
    turned into the nearest rotation, which one of float32 is not to 1e-6."""
    U, _, Vt = np.linalg.svd(R)
    T = np.eye(4)
    T[:3, :3] = U @ Vt
    T[:3, 3] = unit * np.ravel(t) + target.mean(axis=0) - T[:3, :3] @ source.mean(axis=0)
    return T
