"""Pairs of scans of generated worlds, and pairs of like worlds that no pose registers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from benchmarks.worlds.families import FAMILIES
from benchmarks.worlds.scanners import Scan
from mpe_core import RegistrationOptions
from mpe_core.geometry.cell_list import voxel_downsample
from mpe_core.geometry.rigid import apply, inverse
from tests.factories.clouds import motion, random_rotation

Array = NDArray[np.float64]

MIN_OVERLAP = 0.08
"""Share of the source near the target below which a pair is drawn again."""

VOXEL, OVERLAP_RADIUS, TRANSLATION_TOL, ROTATION_TOL_DEG = 1 / 200, 0.0125, 0.02, 2.0
"""Thinning, radius of the overlap, and largest errors of a right pose; lengths in distances from
the target's centre that a tenth of its points exceeds."""

MAX_TRIES = 40


@dataclass(frozen=True)
class WorldPair:
    """Two scans; the source is turned and moved at random."""

    name: str
    family: str
    source: Array
    """(N, 3) points."""
    target: Array
    """(M, 3) points."""
    T_target_source: Array | None
    """(4, 4) true pose; None where both show something else."""
    overlap: float
    """Share of the source that the target shows, too."""
    source_viewpoint: Array | None
    """(3,) position of the scanner in the source's frame, if there is one."""
    target_viewpoint: Array | None
    """(3,) position of the scanner in the target's frame, if there is one."""
    max_rotation_deg: float = ROTATION_TOL_DEG
    max_translation: float = 0.0

    def tolerance(self) -> dict[str, float]:
        """Return the largest errors of a right pose, as pairs.json has them."""
        return {"max_rotation_deg": self.max_rotation_deg, "max_translation": self.max_translation}

    def viewpoint_options(self) -> RegistrationOptions | None:
        """Return options with both viewpoints; None unless both are known."""
        if self.source_viewpoint is None or self.target_viewpoint is None:
            return None
        (a, b, c), (x, y, z) = self.source_viewpoint.tolist(), self.target_viewpoint.tolist()
        return RegistrationOptions(source_viewpoint=(a, b, c), target_viewpoint=(x, y, z))


def world_pairs(count: int, first: int = 0) -> Iterator[WorldPair]:
    """Yield `count` pairs of each family, from the number `first` on; always the same."""
    for family in FAMILIES:
        for number in range(first, first + count):
            yield world_pair(family, number)


def foreign_pairs(count: int, first: int = 0) -> Iterator[WorldPair]:
    """Yield `count` pairs of each family whose scans show two worlds of the same kind."""
    for family in FAMILIES:
        for number in range(first, first + count):
            yield foreign_pair(family, number)


def world_pair(family: str, number: int) -> WorldPair:
    """Return the pair of a family with this number; always the same."""
    for attempt in range(MAX_TRIES):
        scans = _scans(family, [number, 0], [number, attempt])
        pair = _moved(f"{family} {number}", family, scans, number, is_foreign=False)
        if pair.overlap >= MIN_OVERLAP:
            break
    return pair


def foreign_pair(family: str, number: int) -> WorldPair:
    """Return the pair of two worlds of a family with this number; always the same."""
    scans = [_scans(family, [number, 1000 + k], [number, 2000])[k] for k in range(2)]
    return _moved(f"{family} {number} foreign", family, scans, number, is_foreign=True)


def _scans(family: str, world: list[int], scanner: list[int]) -> list[Scan]:
    name = list(family.encode())
    _, scan = FAMILIES[family](
        np.random.default_rng([*world, *name]), np.random.default_rng([*scanner, *name, 7])
    )
    return [scan(k) for k in range(2)]


def _moved(
    name: str, family: str, scans: list[Scan], number: int, *, is_foreign: bool
) -> WorldPair:
    """Turn the first scan at random and lay the truth beside it."""
    source, target = scans
    offsets = target.points - target.points.mean(axis=0)
    radius = float(np.quantile(np.linalg.norm(offsets, axis=1), 0.9))
    x, y = (
        voxel_downsample(scan.points.astype(np.float32), VOXEL * radius).astype(np.float64)
        for scan in scans
    )
    rng = np.random.default_rng([number, 3])
    away = motion(x, random_rotation(rng), rng)
    truth = inverse(target.T_world_scan) @ source.T_world_scan
    near = KDTree(y).query(apply(truth, x), distance_upper_bound=OVERLAP_RADIUS * radius)[0]
    return WorldPair(
        name=name,
        family=family,
        source=apply(away, x),
        target=y,
        T_target_source=None if is_foreign else truth @ inverse(away),
        overlap=0.0 if is_foreign else float(np.isfinite(near).mean()),
        source_viewpoint=away[:3, 3] if source.has_viewpoint else None,
        target_viewpoint=np.zeros(3) if target.has_viewpoint else None,
        max_translation=TRANSLATION_TOL * radius,
    )
