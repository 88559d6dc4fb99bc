"""The pose that the caller said wins over others that fit as well."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, TypeVar

from mpe_core.assess.confidence import Evidence

AGREEMENT_MARGIN = 0.08
"""Surface agreement by which the near pose may fall short of the best one: as for ambiguous poses.
How many points lie on the surface does not count: a bay off, more of a facade overlaps."""

NEARER = 0.5
"""Distance from the start, over that of the best pose, from which on a pose is nearer at all."""


class _Scored(Protocol):
    @property
    def evidence(self) -> Evidence: ...


Pose = TypeVar("Pose", bound=_Scored)


def prefer_near_start(poses: Sequence[Pose], distance: Callable[[Pose], float]) -> list[Pose]:
    """Order poses by their evidence, but the nearest to the start of those that fit as well first.

    Parameters
    ----------
    poses
        Poses in any order.
    distance
        How far a pose is from the start.
    """
    ordered = sorted(poses, key=lambda pose: pose.evidence.sort_key, reverse=True)
    best = ordered[0]
    equal = [pose for pose in ordered if _fits_as_well(pose.evidence, best.evidence)]
    nearest = min(equal, key=distance, default=best)
    if distance(nearest) > NEARER * distance(best):
        return ordered
    return [nearest, *(pose for pose in ordered if pose is not nearest)]


def _fits_as_well(other: Evidence, best: Evidence) -> bool:
    near = other.surface_agreement >= best.surface_agreement - AGREEMENT_MARGIN
    return other.convinces and near
