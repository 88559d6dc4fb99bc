"""Normals, weights, roughness and spacing of a fitted surface."""

import numpy as np
import pytest

from mpe_core.clouds.surface import FLAT_WEIGHT, VOXEL_SIZE, fit_surface, orient_normals


def sphere(count=40_000, noise=0.0, seed=0):
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    return ((1 + noise * rng.normal(size=(count, 1))) * directions).astype(np.float32)


def test_normals_of_a_sphere_are_radial():
    surface = fit_surface(sphere())
    cosine = np.abs(np.einsum("ni,ni->n", surface.points, surface.normals))
    assert np.median(cosine) > 0.999


def test_the_spacing_is_that_of_the_points():
    surface = fit_surface(sphere())
    assert surface.spacing == pytest.approx(np.sqrt(4 * np.pi / len(surface.points)), rel=0.15)
    assert surface.spacing == pytest.approx(VOXEL_SIZE, rel=0.4)


def test_roughness_grows_with_the_noise():
    clean, noisy, noisier = (fit_surface(sphere(noise=s)).roughness for s in (0, 0.01, 0.03))
    assert clean < 0.002
    assert clean < noisy < noisier
    assert noisier == pytest.approx(0.03, rel=0.5)


def test_edges_weigh_more_than_flat_places_and_stray_points_nothing():
    rng = np.random.default_rng(1)
    x, y = rng.uniform(-1, 1, (2, 40_000))
    roof = np.column_stack([x, y, -np.abs(x)])
    points = np.vstack([roof, [[0, 0, 3], [0.5, 0.5, 4]]]).astype(np.float32)
    surface = fit_surface(points)
    ridge = np.abs(surface.points[:, 0]) < 0.02
    flat = np.abs(np.abs(surface.points[:, 0]) - 0.5) < 0.2
    stray = surface.points[:, 2] > 1
    assert np.median(surface.weights[ridge]) > 5 * np.median(surface.weights[flat])
    assert np.median(surface.weights[flat]) == pytest.approx(FLAT_WEIGHT, rel=0.5)
    assert stray.sum() == 2
    assert not surface.weights[stray].any()


def test_oriented_normals_face_the_viewpoint():
    surface = fit_surface(sphere())
    viewpoint = np.array([0.0, 0, 5])
    turned = orient_normals(surface.points, surface.normals, viewpoint[None])
    assert (np.einsum("ni,ni->n", turned, viewpoint - surface.points) >= 0).all()
    np.testing.assert_array_equal(np.abs(turned), np.abs(surface.normals))


def test_both_sides_of_a_wall_face_the_scanner_in_front_of_them():
    x, z = np.random.default_rng(0).uniform(-1, 1, (2, 4000))
    sides = [np.column_stack([x, np.full_like(x, y), z]).astype(np.float32) for y in (-0.2, 0.2)]
    points, normals = np.concatenate(sides), np.tile(np.float32([0, 1, 0]), (8000, 1))
    turned = orient_normals(points, normals, np.array([[0.3, -2.0, 0], [-0.3, 2.0, 0]]))
    np.testing.assert_array_equal(turned[:, 1], np.sign(points[:, 1]))
