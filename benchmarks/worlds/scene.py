"""Scenes of simple bodies, in metres with z up, and rays that are cast at them."""

from __future__ import annotations

import numpy as np
import open3d as o3d
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
Vector = tuple[float, float, float]


class Scene:
    """Bodies that stand where they were added."""

    def __init__(self) -> None:
        """Start with nothing."""
        self._scene = o3d.t.geometry.RaycastingScene()

    def box(self, centre: Vector, size: Vector, yaw: float = 0.0, tilt: float = 0.0) -> None:
        """Add a box, turned by the yaw about z and by the tilt about its own y, in radians."""
        mesh = o3d.geometry.TriangleMesh.create_box(*size)
        mesh.translate(-np.array(size) / 2)
        self._add(mesh, centre, Rotation.from_euler("yz", [tilt, yaw]).as_matrix())

    def cylinder(
        self, foot: Vector, radius: float, height: float, lean: Vector = (0, 0, 0)
    ) -> None:
        """Add a cylinder on its foot, turned by the rotation vector `lean`."""
        mesh = o3d.geometry.TriangleMesh.create_cylinder(radius, height, 16, 1)
        mesh.translate((0, 0, height / 2))
        self._add(mesh, foot, Rotation.from_rotvec(lean).as_matrix())

    def cone(self, foot: Vector, radius: float, height: float) -> None:
        """Add a cone on its foot."""
        self._add(o3d.geometry.TriangleMesh.create_cone(radius, height, 16, 1), foot, np.eye(3))

    def blob(self, centre: Vector, radii: Vector, rng: np.random.Generator, bumps: float) -> None:
        """Add an ellipsoid with smooth bumps of up to this share of its radii."""
        mesh = o3d.geometry.TriangleMesh.create_sphere(1.0, 24)
        x = np.asarray(mesh.vertices)
        waves, phases = rng.normal(0, 2.5, (4, 3)), rng.uniform(0, 2 * np.pi, 4)
        height = np.sin(np.einsum("ki,ni->nk", waves, x) + phases).mean(axis=1)
        mesh.vertices = o3d.utility.Vector3dVector(x * (1 + bumps * height[:, None]) * radii)
        self._add(mesh, centre, Rotation.random(rng=rng).as_matrix())

    def terrain(self, extent: float, relief: float, rng: np.random.Generator) -> None:
        """Add ground over a square of this half edge, with waves of this height."""
        n = 80
        axis = np.linspace(-extent, extent, n)
        x, y = np.meshgrid(axis, axis, indexing="ij")
        self.surface(x, y, ground_height(x, y, relief, rng))

    def surface(self, x: Array, y: Array, z: Array) -> None:
        """Add the surface through grids (n, m) of positions."""
        n, m = x.shape
        row = np.arange(n * m).reshape(n, m)
        a, b, c, d = (g.ravel() for g in (row[:-1, :-1], row[1:, :-1], row[:-1, 1:], row[1:, 1:]))
        mesh = o3d.geometry.TriangleMesh(
            o3d.utility.Vector3dVector(np.column_stack([x.ravel(), y.ravel(), z.ravel()])),
            o3d.utility.Vector3iVector(np.vstack([np.stack([a, b, c], 1), np.stack([b, d, c], 1)])),
        )
        self._add(mesh, (0, 0, 0), np.eye(3))

    def cast(self, origins: Array, directions: Array) -> Array:
        """(N,) distances along rays with origins (N, 3) or (3,) and unit directions (N, 3)."""
        rays = np.empty((len(directions), 6), np.float32)
        rays[:, :3], rays[:, 3:] = origins, directions
        hits = self._scene.cast_rays(o3d.core.Tensor(rays))["t_hit"].numpy()
        distances: Array = hits.astype(np.float64)
        return distances

    def _add(self, mesh: o3d.geometry.TriangleMesh, centre: Vector, R: Array) -> None:
        mesh.rotate(R, center=(0, 0, 0))
        mesh.translate(centre)
        self._scene.add_triangles(o3d.t.geometry.TriangleMesh.from_legacy(mesh))


def ground_height(x: Array, y: Array, relief: float, rng: np.random.Generator) -> Array:
    """Heights of rolling ground at positions of any shape; the same for the same generator."""
    z = np.zeros_like(x)
    for _ in range(5):
        (u, v), phase = rng.normal(0, 0.12, 2), rng.uniform(0, 2 * np.pi)
        z += relief / 5 * np.sin(u * x + v * y + phase)
    return z
