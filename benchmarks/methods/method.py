"""What every method offers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Method:
    """A registration method; `register` gives T_target_source for clouds (N, 3) and (M, 3)."""

    name: str
    package: str
    register: Callable[[Array, Array], Array]
    settings: str
    """The settings it runs with, in words."""

    @property
    def version(self) -> str:
        return f"{self.package} {version(self.package)}"


def diagonal(cloud: Array) -> float:
    """Length of the diagonal of the bounding box."""
    return float(np.linalg.norm(np.ptp(cloud, axis=0)))


def centred_start(source: Array, target: Array) -> Array:
    """(4, 4) pose that lays the centroids on each other and turns nothing."""
    T = np.eye(4)
    T[:3, 3] = target.mean(axis=0) - source.mean(axis=0)
    return T
