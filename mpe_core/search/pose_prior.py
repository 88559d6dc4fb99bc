"""Prior knowledge of the pose between the normalized clouds."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from mpe_core.clouds.normalize import CloudPair
from mpe_core.geometry.rigid import inverse, pose, rotation_between
from mpe_core.geometry.rotations import even_rotations
from mpe_core.options import RegistrationOptions

Array = NDArray[np.float64]

MAX_ROTATION_DEG, MAX_SHIFT = 30.0, 0.5
"""Distance from the initial pose that is searched, in degrees and radii of the smaller cloud."""

MAX_TILT_DEG = 15.0
"""Angle by which the two gravity directions may disagree."""

END_SLACK = 1.5
"""Ranges within which descents may end, over those in which they start."""

OVERSAMPLING = 16
"""Number of rotations over that of a search without prior: the ranges keep a hundredth of them, 10
degrees apart instead of 26."""

DOWN = (0.0, 0.0, -1.0)
"""Direction of gravity where none is given."""


@dataclass(frozen=True, slots=True)
class PosePrior:
    """Region of poses that the search is restricted to."""

    initial: Array | None = None
    """(4, 4) pose that the search keeps near."""
    down: tuple[Array, Array] | None = None
    """(3,) unit vectors in the source and in the target that the pose aligns within a tolerance."""
    yaw_only: bool = False
    """Whether the pose aligns them exactly."""
    max_rotation_deg: float = MAX_ROTATION_DEG
    """Angle to the initial pose up to which descents start."""
    max_shift: float = MAX_SHIFT
    """Distance from the initial pose up to which descents start."""

    @classmethod
    def from_options(cls, options: RegistrationOptions, pair: CloudPair) -> Self:
        """Read initial pose and gravity from the options."""
        initial, gravity = options.initial_transform, options.source_gravity
        has_vertical = gravity is not None or options.yaw_only
        down = _unit(gravity or DOWN), _unit(options.target_gravity or DOWN)
        return cls(
            initial=None if initial is None else pair.from_caller(np.array(initial)),
            down=down if has_vertical else None,
            yaw_only=options.yaw_only,
            max_rotation_deg=(options.max_rotation_deg or END_SLACK * MAX_ROTATION_DEG) / END_SLACK,
            max_shift=(options.max_translation or END_SLACK * MAX_SHIFT * pair.unit)
            / (END_SLACK * pair.unit),
        )

    def inverse(self) -> PosePrior:
        """Exchange source and target."""
        initial = None if self.initial is None else inverse(self.initial)
        down = None if self.down is None else (self.down[1], self.down[0])
        return replace(self, initial=initial, down=down)

    def rotations(self, count: int) -> Array:
        """(K, 3, 3) rotations to start from; `count` of them without a prior."""
        if self.initial is None and self.down is None:
            return even_rotations(count)
        rotations = even_rotations(self._oversampling() * count)
        rotations = rotations[self._are_in_range(rotations, 1.0)]
        if self.initial is not None:
            rotations = np.concatenate([self.initial[None, :3, :3], rotations])
        return np.array([self._remove_tilt(R) for R in rotations])

    def translations(self, proposed: NDArray[np.float32]) -> NDArray[np.float32]:
        """(K, 3) translations to start from, for the proposed ones of `rotations`.

        Proposals that are far from the initial pose are replaced by its translation.
        """
        if self.initial is None:
            return proposed
        known = self.initial[:3, 3]
        is_far = np.linalg.norm(proposed - known, axis=1) > self.max_shift
        near: NDArray[np.float32] = np.where(is_far[:, None], known, proposed).astype(np.float32)
        near[0] = known  # the first rotation is the initial one
        return near

    def accepts(self, poses: Array) -> NDArray[np.bool_]:
        """(K,) whether descents may end at the poses (K, 4, 4)."""
        accepted = self._are_in_range(poses[:, :3, :3], END_SLACK)
        if self.initial is not None:
            shift = np.linalg.norm(poses[:, :3, 3] - self.initial[:3, 3], axis=1)
            accepted &= shift <= END_SLACK * self.max_shift
        return accepted

    def distance(self, T: Array) -> float:
        """Distance of a pose (4, 4) from the initial one, in ranges of the search."""
        assert self.initial is not None  # noqa: S101
        cosine = (np.trace(T[:3, :3].T @ self.initial[:3, :3]) - 1) / 2
        angle = float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))
        shift = float(np.linalg.norm(T[:3, 3] - self.initial[:3, 3]))
        return angle / self.max_rotation_deg + shift / self.max_shift

    def _oversampling(self) -> int:
        """Rotations over those of a search without prior; fewer where the range keeps many."""
        angle = np.radians(END_SLACK * self.max_rotation_deg)
        if self.initial is None or self.max_rotation_deg <= MAX_ROTATION_DEG:
            return OVERSAMPLING
        return int(np.clip(np.ceil(np.pi / (angle - np.sin(angle))), 1, OVERSAMPLING))

    def project_to_yaw(self, T: Array) -> Array:
        """(4, 4) pose next to T that turns about the vertical alone, if only yaw is allowed."""
        return pose(self._remove_tilt(T[:3, :3]), T[:3, 3])

    def motion_basis(self) -> Array:
        """(6, K) basis of the small motions (rotation vector, translation) that are allowed."""
        basis = np.eye(6)
        if self.down is None or not self.yaw_only:
            return basis
        turn = np.concatenate([self.down[1], np.zeros(3)])
        return np.column_stack([turn, basis[:, 3:]])

    def _are_in_range(self, rotations: Array, slack: float) -> NDArray[np.bool_]:
        """(K,) whether rotations (K, 3, 3) lie within the ranges times slack."""
        in_range = np.ones(len(rotations), np.bool_)
        if self.initial is not None:
            trace = np.einsum("kij,ij->k", rotations, self.initial[:3, :3])
            in_range &= trace >= 1 + 2 * np.cos(
                np.radians(min(slack * self.max_rotation_deg, 180.0))
            )
        if self.down is not None:
            cosine = np.einsum("kij,j,i->k", rotations, *self.down)
            in_range &= cosine >= np.cos(np.radians(slack * MAX_TILT_DEG))
        return in_range

    def _remove_tilt(self, R: Array) -> Array:
        if self.down is None or not self.yaw_only:
            return R
        level: Array = rotation_between(R @ self.down[0], self.down[1]) @ R
        return level


def _unit(vector: tuple[float, ...]) -> Array:
    shrunk = np.array(vector) / np.abs(vector).max()  # the square of a tiny one would be 0
    unit: Array = shrunk / np.linalg.norm(shrunk)
    return unit
