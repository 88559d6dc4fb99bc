"""Algorithm 1 of the paper: a rigid cloud falls in the static field of another one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpe_core.geometry.rigid import apply, axis_rotation, pose
from mpe_core.paper.force_field import Field, traction

Array = NDArray[np.float64]

EPS = 0.05
FIRST_TURN, FIRST_MOVE = 0.25, 0.25  # radians, units of length
LAST_TURN, LAST_MOVE = 1e-3, 1e-3


@dataclass(frozen=True, slots=True)
class Descent:
    """Where an iterative method came to rest."""

    T_target_source: Array
    converged: bool
    iterations: int


def descend(
    source: Array,
    field: Field,
    max_iterations: int,
    report: Callable[[float], None],
    weights: Array | None = None,
) -> Descent:
    """Minimum potential energy of the source (N, 3) in the field, from where it lies (Algorithm 1).

    The weights (N,) are the K_i of Eq. 7, 1 where none are given: they multiply the forces. C is
    the centre of mass, so a point of weight 2 is two points in one place, and a point of next to no
    weight moves neither the forces nor the axis of the turn. Only directions matter: the pose is
    the same for all weights times a constant.

    Each iteration turns the cloud about C by s_R around the torque T and moves it by
    s_t along the gravitational vector S. A vector that points against its last value tells that
    the minimum was crossed, and its step is halved. The paper's pseudocode nests the second test
    in the first and stops when either step is small; its text treats both as independent. We
    follow the text: independent halving until both steps are small.
    """
    centre, turn, move = np.average(source, axis=0, weights=weights), FIRST_TURN, FIRST_MOVE
    K = np.float64(1) if weights is None else weights[:, None]
    T, last_torque, last_gravity = np.eye(4), np.zeros(3), np.zeros(3)
    for iteration in range(max_iterations):
        report(iteration / max_iterations)
        points, here = apply(T, source), T[:3, :3] @ centre + T[:3, 3]
        torque, gravity = traction(points, here, K * field.force(points))
        if torque @ last_torque < 0:
            turn /= 2
        if gravity @ last_gravity < 0:
            move /= 2
        if turn < LAST_TURN and move < LAST_MOVE:
            return Descent(T, True, iteration)
        T = _step(here, torque, turn, gravity, move) @ T
        last_torque, last_gravity = torque, gravity
    return Descent(T, False, max_iterations)


def _step(centre: Array, torque: Array, turn: float, gravity: Array, move: float) -> Array:
    R = axis_rotation(torque, turn) if torque.any() else np.eye(3)
    length = np.linalg.norm(gravity)
    return pose(R, centre - R @ centre + (move / length * gravity if length else 0))
