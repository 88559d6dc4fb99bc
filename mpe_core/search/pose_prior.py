"""What the caller knows about the pose beforehand, between the centred, scaled clouds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from mpe_core.clouds.normalize import CloudPair
from mpe_core.geometry.rigid import axis_rotation, inverse, pose
from mpe_core.geometry.rotations import even_rotations
from mpe_core.options import RegistrationOptions

Array = NDArray[np.float64]

NEAR_DEGREES, NEAR = 30.0, 0.5
"""How far from the initial pose is searched, in degrees and radii of the smaller cloud."""

TILT_DEGREES = 15.0
"""How far the two gravity directions may disagree."""

DRIFT = 1.5
"""Where descents may end, in these ranges."""

DENSER = 16
"""Over the rotations of a search without knowledge: the ranges above keep a hundredth of them, and
leave them 10 degrees apart instead of 26."""

DOWN = (0.0, 0.0, -1.0)


@dataclass(frozen=True, slots=True)
class PosePrior:
    """Which poses are worth a look."""

    initial: Array | None = None
    """(4, 4) pose that the search keeps near."""
    down: tuple[Array, Array] | None = None
    """(3,) unit vectors in the source and in the target that the pose lays on each other, about."""
    yaw_only: bool = False
    """They are laid on each other exactly."""

    @classmethod
    def of(cls, options: RegistrationOptions, pair: CloudPair) -> Self:
        """What the options say."""
        given, initial = options.source_gravity, options.initial_transform
        level = given is not None or options.yaw_only
        down = _unit(given or DOWN), _unit(options.target_gravity or DOWN)
        return cls(
            initial=None if initial is None else pair.from_caller(np.array(initial)),
            down=down if level else None,
            yaw_only=options.yaw_only,
        )

    def inverse(self) -> PosePrior:
        """The same with source and target exchanged."""
        initial = None if self.initial is None else inverse(self.initial)
        down = None if self.down is None else (self.down[1], self.down[0])
        return PosePrior(initial, down, self.yaw_only)

    def rotations(self, count: int) -> Array:
        """(K, 3, 3) rotations to try, `count` of them where nothing is known."""
        if self.initial is None and self.down is None:
            return even_rotations(count)
        tried = even_rotations(DENSER * count)
        tried = tried[self._turns(tried, 1.0)]
        if self.initial is not None:
            tried = np.concatenate([self.initial[None, :3, :3], tried])
        return np.array([self._level(R) for R in tried])

    def translations(self, proposed: NDArray[np.float32]) -> NDArray[np.float32]:
        """(K, 3) translations to try: the proposed ones, or the initial one where they are far."""
        if self.initial is None:
            return proposed
        known = self.initial[:3, 3]
        far = np.linalg.norm(proposed - known, axis=1) > NEAR
        nearby: NDArray[np.float32] = np.where(far[:, None], known, proposed).astype(np.float32)
        nearby[0] = known  # the first rotation is the initial one
        return nearby

    def allows(self, poses: Array) -> NDArray[np.bool_]:
        """(K,) whether poses (K, 4, 4) may be the answer."""
        allowed = self._turns(poses[:, :3, :3], DRIFT)
        if self.initial is not None:
            off = np.linalg.norm(poses[:, :3, 3] - self.initial[:3, 3], axis=1)
            allowed &= off <= DRIFT * NEAR
        return allowed

    def level(self, T: Array) -> Array:
        """The pose, or the one next to it that turns about the vertical alone."""
        return pose(self._level(T[:3, :3]), T[:3, 3])

    def motions(self) -> Array:
        """(6, K) basis of the small motions (rotation vector, translation) that are allowed."""
        basis = np.eye(6)
        if self.down is None or not self.yaw_only:
            return basis
        turn = np.concatenate([self.down[1], np.zeros(3)])
        return np.column_stack([turn, basis[:, 3:]])

    def _turns(self, rotations: Array, slack: float) -> NDArray[np.bool_]:
        """(K,) whether rotations (K, 3, 3) lie within the ranges times slack."""
        allowed = np.ones(len(rotations), np.bool_)
        if self.initial is not None:
            trace = np.einsum("kij,ij->k", rotations, self.initial[:3, :3])
            allowed &= trace >= 1 + 2 * np.cos(np.radians(slack * NEAR_DEGREES))
        if self.down is not None:
            agree = np.einsum("kij,j,i->k", rotations, *self.down)
            allowed &= agree >= np.cos(np.radians(slack * TILT_DEGREES))
        return allowed

    def _level(self, R: Array) -> Array:
        if self.down is None or not self.yaw_only:
            return R
        down, vertical = R @ self.down[0], self.down[1]
        axis = np.cross(down, vertical)
        if not axis.any():
            return R
        tilt = float(np.arctan2(np.linalg.norm(axis), down @ vertical))
        level: Array = axis_rotation(axis, tilt) @ R
        return level


def _unit(vector: tuple[float, ...]) -> Array:
    shrunk = np.array(vector) / np.abs(vector).max()  # the square of a tiny one would be 0
    unit: Array = shrunk / np.linalg.norm(shrunk)
    return unit
