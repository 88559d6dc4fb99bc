"""Algorithm 1 of the paper: a rigid cloud falls in the static field of another one."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mpe_core.geometry.rigid import apply, axis_rotation, pose
from mpe_core.paper.force_field import ForceField, torque_and_gravity
from mpe_core.refine.minimum import Minimum

Array = NDArray[np.float64]

SOFTENING = 0.05
"""eps of Eq. 7, in radii: bounds the force of a pair. The value of the paper."""

FIRST_ANGLE, FIRST_STEP = 0.25, 0.25
"""First s_R in radians, and first s_t in radii."""

ANGLE_TOL, STEP_TOL = 1e-3, 1e-3
"""s_R and s_t below which the descent has converged."""


def run_algorithm1(
    source: Array,
    field: ForceField,
    max_iterations: int,
    report: Callable[[float], None],
    weights: Array | None = None,
) -> Minimum:
    """Minimize the potential energy of a cloud in a static field, from where it lies.

    Each iteration turns the cloud about its center of mass C by s_R around the torque T, and moves
    it by s_t along the gravitational vector S. A vector that points against its last value has
    passed the minimum, and its step is halved.

    Parameters
    ----------
    source
        (N, 3) cloud.
    field
        Field of the target.
    max_iterations
        Bound on the iterations.
    report
        Receives the fraction of the iterations done, 0 to 1.
    weights
        (N,) K_i of Eq. 7, which multiply the forces and enter C; all 1 where none are given. The
        pose does not change if all are multiplied by a constant.

    Returns
    -------
    T_target_source at rest.

    Notes
    -----
    The pseudocode of the paper nests the test of S in the test of T and stops when either step is
    small; its text treats both as independent. This follows the text.
    """
    center, angle, step = np.average(source, axis=0, weights=weights), FIRST_ANGLE, FIRST_STEP
    K = np.float64(1) if weights is None else weights[:, None]
    T, last_torque, last_gravity = np.eye(4), np.zeros(3), np.zeros(3)
    for iteration in range(max_iterations):
        report(iteration / max_iterations)
        points, here = apply(T, source), T[:3, :3] @ center + T[:3, 3]
        torque, gravity = torque_and_gravity(points, here, K * field.force(points))
        if torque @ last_torque < 0:
            angle /= 2
        if gravity @ last_gravity < 0:
            step /= 2
        if angle < ANGLE_TOL and step < STEP_TOL:
            return Minimum(T, True, iteration)
        T = _motion(here, torque, angle, gravity, step) @ T
        last_torque, last_gravity = torque, gravity
    return Minimum(T, False, max_iterations)


def _motion(center: Array, torque: Array, angle: float, gravity: Array, step: float) -> Array:
    R = axis_rotation(torque, angle) if torque.any() else np.eye(3)
    length = np.linalg.norm(gravity)
    return pose(R, center - R @ center + (step / length * gravity if length else 0))
