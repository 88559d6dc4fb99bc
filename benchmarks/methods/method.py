"""The interface of the compared methods."""

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
    """Return name and version of a package, or None where it is not installed."""
    try:
        return f"{package} {version(package)}"
    except PackageNotFoundError:
        return None


def diagonal(cloud: Array) -> float:
    """Return the length of the diagonal of the bounding box."""
    return float(np.linalg.norm(np.ptp(cloud, axis=0)))


def centered_start(source: Array, target: Array) -> Array:
    """Return the (4, 4) translation that moves the source's centroid onto the target's."""
    T = np.eye(4)
    T[:3, 3] = target.mean(axis=0) - source.mean(axis=0)
    return T


def rigid(R: Array, t: Array, source: Array, target: Array, unit: float) -> Array:
    """Return the (4, 4) pose between clouds, given one between normalized clouds.

    Normalized clouds are centered and divided by `unit`.

    R is replaced by the nearest rotation, which a float32 matrix is not to 1e-6.
    """
    U, _, Vt = np.linalg.svd(R)
    T = np.eye(4)
    T[:3, :3] = U @ Vt
    T[:3, 3] = unit * np.ravel(t) + target.mean(axis=0) - T[:3, :3] @ source.mean(axis=0)
    return T
