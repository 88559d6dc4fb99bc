"""A pose in the forms that programs take, each with its convention."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def describe_pose(
    transform: Sequence[Sequence[float]], scale: float = 1.0
) -> list[tuple[str, str]]:
    """Return names and texts of a pose.

    Parameters
    ----------
    transform : (4, 4)
        Row-major, for column vectors.
    scale
        Its factor, which the angles and the quaternion do without.
    """
    from scipy.spatial.transform import Rotation

    T = np.array(transform, np.float64)
    rotation = Rotation.from_matrix(T[:3, :3] / scale)
    translation = _line(T[:3, 3])
    quaternion = rotation.as_quat(canonical=True)
    angles = _fixed_angles(T[:3, :3] / scale)
    return [
        (
            "4x4 matrix, row-major, for column vectors: x_target = T x_source (Open3D, NumPy)",
            _rows(T),
        ),
        ("The same for CloudCompare (Edit > Apply transformation)", _rows(T, digits=12)),
        ("4x4 matrix, column-major, one line (OpenGL, Eigen's memory)", _line(T.T.ravel())),
        ("Quaternion x, y, z, w, then translation", f"{_line(quaternion)}\n{translation}"),
        (
            "Quaternion w, x, y, z, then translation",
            f"{_line(np.roll(quaternion, 1))}\n{translation}",
        ),
        (
            "Angles in degrees: roll about x, pitch about y, yaw about z; R = Rz(yaw) Ry(pitch) "
            "Rx(roll), about the fixed axes of the target; then translation",
            f"{_line(angles)}\n{translation}",
        ),
        (
            "Rotation vector in degrees (axis times angle), then translation",
            f"{_line(np.degrees(rotation.as_rotvec()))}\n{translation}",
        ),
    ]


def _fixed_angles(R: NDArray[np.float64]) -> list[float]:
    """Return roll, pitch and yaw in degrees; roll is 0 where pitch is a right angle."""
    flat = float(np.hypot(R[0, 0], R[1, 0]))
    pitch = np.arctan2(-R[2, 0], flat)
    if flat < 1e-9:
        return [0.0, float(np.degrees(pitch)), float(np.degrees(np.arctan2(-R[0, 1], R[1, 1])))]
    roll, yaw = np.arctan2(R[2, 1], R[2, 2]), np.arctan2(R[1, 0], R[0, 0])
    return [float(np.degrees(angle)) for angle in (roll, pitch, yaw)]


def _line(values: Sequence[float] | NDArray[np.float64]) -> str:
    return " ".join(f"{value + 0.0:.12g}" for value in values)


def _rows(T: NDArray[np.float64], digits: int = 17) -> str:
    return "\n".join(" ".join(f"{value + 0.0:.{digits}g}" for value in row) for row in T)
