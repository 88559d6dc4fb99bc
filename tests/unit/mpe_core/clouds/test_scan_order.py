"""The order of a scan's points tells where the scanner stood, and other orders tell nothing."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from mpe_core import RegistrationOptions, register
from mpe_core.clouds.scan_order import infer_viewpoint
from mpe_core.geometry.rigid import apply, rotation_error
from tests.factories.clouds import bunny, moved, points_of, real_pair
from tests.factories.worlds import scan_world, street

Array = NDArray[np.float64]


def distance_from(place: Array, cloud: Array) -> float:
    """Distance of the inferred viewpoint from a place, over that of the cloud."""
    found = infer_viewpoint(cloud)
    assert found is not None
    span = np.linalg.norm(cloud - place, axis=1).mean()
    return float(np.linalg.norm(found.position - place) / span)


@pytest.mark.parametrize("name", ["bunny_rgbd/cloudXYZ_0.ply", "bunny_rgbd/cloudXYZ_12.ply"])
def test_a_depth_camera_is_found_where_it_stood(data: Path, name: str) -> None:
    cloud = points_of(data / name)
    rng = np.random.default_rng(0)
    T = moved(cloud, rng).T_target_source
    assert distance_from(np.zeros(3), cloud) < 0.01
    assert distance_from(T[:3, 3], apply(T, cloud)) < 0.01
    assert distance_from(1000 * T[:3, 3], 1000 * apply(T, cloud)) < 0.01


def test_a_spinning_scanner_is_found_where_it_stood(data: Path) -> None:
    rows = np.fromfile(data / "formats" / "kitti_velodyne.bin", np.float32).reshape(-1, 4)
    assert distance_from(np.zeros(3), rows[:, :3].astype(float)) < 0.02
    scan = scan_world(
        street(np.random.default_rng(3)), np.array([2.0, 0.5, 1.7]), np.random.default_rng(4)
    )
    assert distance_from(np.zeros(3), scan.points) < 0.02


def shuffled(cloud: Array) -> Array:
    return np.random.default_rng(0).permutation(cloud)


def thinned(cloud: Array) -> Array:
    """First points of cubes, in the order of the cubes."""
    return cloud[np.unique(np.floor(cloud / 0.01).astype(int), axis=0, return_index=True)[1]]


def merged(cloud: Array) -> Array:
    """Two scans of unlike places in one cloud."""
    return np.vstack([cloud, cloud @ np.diag([-1, 1, -1]) + [0, 0, 3]])


@pytest.mark.parametrize("change", [shuffled, thinned, merged])
def test_clouds_in_another_order_tell_no_place(
    data: Path, change: Callable[[Array], Array]
) -> None:
    cloud = points_of(data / "bunny_rgbd/cloudXYZ_0.ply")
    assert infer_viewpoint(cloud) is not None
    assert infer_viewpoint(change(cloud)) is None


def test_rows_of_parallel_rays_tell_no_place(data: Path) -> None:
    assert infer_viewpoint(points_of(data / "bunny" / "bun000.ply")) is None
    assert infer_viewpoint(points_of(data / "dragon" / "dragonStandRight_264.ply")) is None


def test_few_points_and_grids_of_models_tell_no_place(data: Path) -> None:
    u, v = (g.ravel() for g in np.meshgrid(np.linspace(0, 6.28, 300), np.linspace(0, 3.1, 150)))
    sphere = np.column_stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)])
    ring = np.column_stack(
        [np.cos(u) * (3 + np.cos(2 * v)), np.sin(u) * (3 + np.cos(2 * v)), np.sin(2 * v)]
    )
    for cloud in (sphere, ring, bunny(data), sphere[:20], np.ones((3, 3))):
        assert infer_viewpoint(cloud) is None


def test_the_places_are_used_and_told_unless_unwanted(data: Path) -> None:
    trial = real_pair(data, "bunnyreal_1_0")
    told = register(trial.source, trial.target)
    (notice,) = (each for each in told.warnings if each.code == "viewpoints_inferred")
    assert "certainty 0." in notice
    found = [infer_viewpoint(cloud) for cloud in (trial.source, trial.target)]
    source, target = (each.position for each in found if each is not None)
    given = RegistrationOptions(source_viewpoint=source, target_viewpoint=target)
    same = register(trial.source, trial.target, given)
    assert np.array_equal(told.T_target_source, same.T_target_source)
    assert told.confidence == same.confidence
    assert rotation_error(told.T_target_source, trial.T_target_source) < 0.5
    never = register(trial.source, trial.target, RegistrationOptions(infer_viewpoints="never"))
    assert "viewpoints_inferred" not in [each.code for each in never.warnings]
    assert never.confidence != told.confidence
