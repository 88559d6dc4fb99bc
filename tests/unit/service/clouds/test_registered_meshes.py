"""Meshes as they are read are registered by their surface, either way round."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mpe_core import register
from mpe_core.geometry.rigid import apply, inverse, pose
from service.clouds.transform import transform_cloud
from service.formats import read_surface, write_cloud
from tests.factories.clouds import random_rotation
from tests.factories.meshes import bracket


def test_a_mesh_with_nearly_all_vertices_in_a_thread(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    truth = pose(random_rotation(rng), rng.uniform(-200, 200, 3))
    write_cloud(tmp_path / "part", "obj", transform_cloud(bracket(), inverse(truth)))
    write_cloud(tmp_path / "scanned", "stl", bracket(500))
    mesh = read_surface(tmp_path / "part").points
    scan = read_surface(tmp_path / "scanned", surface_samples=12_000).points
    scan = scan + rng.normal(0, 0.2, scan.shape)
    forth, back = register(mesh, scan), register(scan, mesh)
    assert forth.accepted
    assert back.accepted
    for T in (forth.T_target_source, inverse(back.T_target_source)):
        off = apply(T, mesh) - apply(truth, mesh)
        assert np.sqrt(np.square(off).sum(axis=1).mean()) < 2
