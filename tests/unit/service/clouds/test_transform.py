"""Transforms and merges keep what belongs to each point."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import DTypeLike, NDArray
from scipy.spatial.transform import Rotation

from service.clouds.transform import adopt_crs, merge_clouds, transform_cloud
from service.formats import DecodedCloud, LasRecord

RNG = np.random.default_rng(5)
T = np.eye(4)
T[:3, :3] = Rotation.from_euler("xyz", [20, -50, 130], degrees=True).as_matrix()
T[:3, 3] = (4, -2, 0.5)


def random_points(dtype: DTypeLike = np.float64) -> NDArray[np.floating]:
    return RNG.normal(size=(50, 3)).astype(dtype)


def cloud_of(
    points: NDArray[np.floating], attributes: Mapping[str, NDArray[np.generic]] | None = None
) -> DecodedCloud:
    return DecodedCloud(points, "ply", attributes=dict(attributes or {}))


def test_points_are_rotated_and_shifted() -> None:
    points = random_points()
    moved = transform_cloud(cloud_of(points), T).points
    np.testing.assert_allclose(moved, [T[:3, :3] @ point + T[:3, 3] for point in points])


def test_a_transform_and_its_inverse_cancel() -> None:
    cloud = cloud_of(random_points(), {"nx": RNG.normal(size=50)})
    back = transform_cloud(transform_cloud(cloud, T), np.linalg.inv(T))
    np.testing.assert_allclose(back.points, cloud.points, atol=1e-12)


def test_nan_rows_stay_where_they_are() -> None:
    points = random_points()
    points[7] = np.nan
    moved = transform_cloud(cloud_of(points), T).points
    assert np.flatnonzero(np.isnan(moved).any(axis=1)).tolist() == [7]


@pytest.mark.parametrize("names", [("nx", "ny", "nz"), ("normal_z", "normal_x", "normal_y")])
def test_normals_are_rotated_but_not_shifted(names: tuple[str, str, str]) -> None:
    by_axis = {name[-1]: name for name in names}
    normals = RNG.normal(size=(50, 3)).astype(np.float32)
    columns = {by_axis[axis]: normals[:, "xyz".index(axis)] for axis in ("z", "x", "y")}
    cloud = cloud_of(random_points(), columns | {"intensity": np.arange(50)})
    moved = transform_cloud(cloud, T).attributes
    turned = np.stack([moved[by_axis[axis]] for axis in "xyz"], axis=1)
    np.testing.assert_allclose(turned, normals @ T[:3, :3].T, rtol=1e-5, atol=1e-6)
    assert turned.dtype == np.float32
    assert list(moved) == list(cloud.attributes)


def test_other_attributes_and_the_given_cloud_are_not_changed() -> None:
    attributes = {"intensity": np.arange(50, dtype=np.uint16), "nx": RNG.normal(size=50)}
    cloud = cloud_of(random_points(), attributes)
    points = cloud.points.copy()
    moved = transform_cloud(cloud, T)
    for name, values in attributes.items():  # one component alone is no normal
        np.testing.assert_array_equal(moved.attributes[name], values)
        assert moved.attributes[name].dtype == values.dtype
    np.testing.assert_array_equal(cloud.points, points)


def test_normals_without_attributes_become_attributes() -> None:
    normals = RNG.normal(size=(50, 3))
    cloud = DecodedCloud(random_points(), "stl", normals=normals)
    moved = transform_cloud(cloud, T).attributes
    turned = np.stack([moved[name] for name in ("nx", "ny", "nz")], axis=1)
    np.testing.assert_allclose(turned, normals @ T[:3, :3].T)


@pytest.mark.parametrize(
    ("dtype", "shift", "expected"),
    [
        (np.float32, 1.0, np.float32),
        (np.float32, 1e6, np.float64),  # float32 would round to 0.06
        (np.float64, 1.0, np.float64),
    ],
)
def test_float32_is_kept_while_it_can_hold_the_points(
    dtype: DTypeLike, shift: float, expected: DTypeLike
) -> None:
    far = np.eye(4)
    far[0, 3] = shift
    points = random_points(dtype)
    moved = transform_cloud(cloud_of(points), far).points
    assert moved.dtype == expected
    np.testing.assert_allclose(moved[:, 0] - shift, points[:, 0], atol=1e-5)


def test_a_cloud_without_a_finite_point_can_be_moved() -> None:
    points = np.full((3, 3), np.nan, np.float32)
    assert transform_cloud(cloud_of(points), T).points.dtype == np.float32


def test_merging_keeps_the_attributes_that_both_have_in_the_same_type() -> None:
    source = cloud_of(
        random_points(),
        {"a": np.arange(50), "b": np.arange(50), "only_source": np.arange(50)},
    )
    target = cloud_of(
        random_points(),
        {"b": np.arange(50.0), "a": np.arange(100, 150), "only_target": np.arange(50)},
    )
    merged = merge_clouds(source, target)
    assert list(merged.attributes) == ["a", "cloud"]
    np.testing.assert_array_equal(merged.attributes["a"], np.r_[:50, 100:150])


def test_merged_points_say_which_cloud_they_are_of() -> None:
    source, target = cloud_of(random_points()), cloud_of(random_points()[:20])
    merged = merge_clouds(source, target)
    np.testing.assert_array_equal(merged.points, np.concatenate([source.points, target.points]))
    assert merged.attributes["cloud"].dtype == np.uint8
    assert merged.attributes["cloud"].tolist() == [0] * 50 + [1] * 20


def test_velocities_and_the_viewpoint_turn() -> None:
    velocity = RNG.normal(size=(50, 3))
    cloud = cloud_of(random_points(), dict(zip(("vx", "vy", "vz"), velocity.T, strict=True)))
    turn = Rotation.from_euler("x", 30, degrees=True)
    viewpoint = (1.0, 2.0, 3.0, *np.roll(turn.as_quat(), 1).tolist())
    moved = transform_cloud(replace(cloud, viewpoints=(viewpoint,)), T)
    turned = np.stack([moved.attributes[name] for name in ("vx", "vy", "vz")], axis=1)
    np.testing.assert_allclose(turned, velocity @ T[:3, :3].T)
    (pose,) = moved.viewpoints
    np.testing.assert_allclose(pose[:3], T[:3, :3] @ (1, 2, 3) + T[:3, 3])
    found = Rotation.from_quat(np.roll(pose[3:], -1)).as_matrix()
    np.testing.assert_allclose(found, T[:3, :3] @ turn.as_matrix(), atol=1e-12)


def test_faces_of_both_clouds_are_merged() -> None:
    faces = np.array([[0, 1, 2], [3, 4, 5]])
    first = replace(cloud_of(random_points()), faces=faces)
    merged = merge_clouds(first, replace(cloud_of(random_points()), faces=faces))
    assert merged.faces is not None
    np.testing.assert_array_equal(merged.faces, np.concatenate([faces, faces + 50]))


def test_the_coordinate_system_is_that_of_the_target() -> None:
    utm = (LasRecord("LASF_Projection", 2112, "", b"UTM"),)
    cloud = replace(cloud_of(random_points()), crs=(LasRecord("LASF_Projection", 34735, "", b""),))
    assert adopt_crs(cloud, utm).crs == utm
    assert adopt_crs(cloud, utm).warnings == ()
    left = adopt_crs(cloud, ())
    assert left.crs == ()
    assert "coordinate system" in left.warnings[0]
