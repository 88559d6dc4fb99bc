"""Clouds as files to upload, and the pose that is true for them."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from service.formats import read_points

Pose = NDArray[np.float64]
Points = NDArray[np.float64]


def pair(data: Path, name: str) -> dict[str, Any]:
    """The entry of pairs.json whose source's path contains the name."""
    pairs: list[dict[str, Any]] = json.loads((data / "pairs.json").read_text())
    return next(entry for entry in pairs if name in entry["id"])


def points(path: Path) -> Points:
    return read_points(path).points.astype(np.float64)


def as_npy(cloud: Points) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, cloud.astype(np.float32))
    return buffer.getvalue()


def motion(rng: np.random.Generator, cloud: Points, angle_deg: float, shift: float) -> Pose:
    """A turn by the angle about a random axis through the centroid, and a move by `shift`."""
    axis, direction = rng.normal(size=(2, 3))
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec(
        np.radians(angle_deg) * axis / np.linalg.norm(axis)
    ).as_matrix()
    centre = cloud.mean(axis=0)
    pose[:3, 3] = centre - pose[:3, :3] @ centre + shift * direction / np.linalg.norm(direction)
    return pose


def moved(pose: Pose, cloud: Points) -> Points:
    return cloud @ pose[:3, :3].T + pose[:3, 3]


def pose_error(found: Pose, truth: Pose, cloud: Points) -> tuple[float, float]:
    """Rotation between the poses in degrees, and how far apart they put the cloud's centroid."""
    between = Rotation.from_matrix(found[:3, :3] @ truth[:3, :3].T)
    centre = cloud.mean(axis=0, keepdims=True)
    shift = moved(found, centre) - moved(truth, centre)
    return float(np.degrees(between.magnitude())), float(np.linalg.norm(shift))


def arms(seed: int, count: int = 300) -> Points:
    """A small cloud that no rotation maps onto itself, quick to register: three unequal arms."""
    rng = np.random.default_rng(seed)
    cloud = 0.15 * rng.normal(size=(count, 3))
    arm = rng.choice(3, size=count, p=(0.5, 0.3, 0.2))
    cloud[np.arange(count), arm] += rng.uniform(size=count) * np.array((3.0, 2.0, 1.2))[arm]
    return cloud
