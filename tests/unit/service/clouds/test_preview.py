"""Previews hold the points of the cloud in full precision, with colours and distances."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from service.clouds.preview import (
    HAS_COLORS,
    HAS_DISTANCES,
    HEADER,
    choose_rows,
    write_preview,
)
from service.formats import DecodedCloud

FAR = np.array([500_000.0, 4_000_000.0, 100.0])
POINTS = np.random.default_rng(0).uniform(-1, 1, (500, 3)) + FAR


def read(path: Path) -> tuple[int, int, NDArray[np.float64], bytes]:
    """Flags, number of points of the whole cloud, positions, and the bytes after them."""
    content = path.read_bytes()
    magic, version, flags, count, total, *origin = HEADER.unpack_from(content)
    assert (magic, version) == (b"MPEV", 1)
    end = HEADER.size + 12 * count
    points = np.frombuffer(content[HEADER.size : end], "<f4").reshape(-1, 3)
    return flags, total, points.astype(np.float64) + origin, content[end:]


@pytest.mark.parametrize("max_points", [1, 100, 500, 1000])
def test_points_are_chosen_from_all_and_are_always_the_same(max_points: int) -> None:
    points = POINTS.copy()
    points[::7] = np.nan
    rows = choose_rows(points, max_points)
    assert len(rows) == min(max_points, np.isfinite(points[:, 0]).sum())
    assert np.isfinite(points[rows]).all()
    assert len(np.unique(rows)) == len(rows)
    np.testing.assert_array_equal(rows, choose_rows(points, max_points))


def test_georeferenced_points_keep_their_precision(tmp_path: Path) -> None:
    path = tmp_path / "preview.bin"
    write_preview(path, DecodedCloud(POINTS, "xyz"), np.arange(0, 500, 5))
    flags, total, points, rest = read(path)
    assert (flags, total, rest) == (0, 500, b"")
    np.testing.assert_allclose(points, POINTS[::5], rtol=0, atol=1e-6)


def test_colours_and_distances_follow(tmp_path: Path) -> None:
    path, rows = tmp_path / "preview.bin", np.array([3, 4])
    attributes = {name: np.arange(500, dtype=np.uint8) + i for i, name in enumerate("rgb")}
    attributes = dict(zip(("red", "green", "blue"), attributes.values(), strict=True))
    cloud = DecodedCloud(POINTS, "ply", attributes=dict(attributes))
    write_preview(path, cloud, rows, np.array([0.5, 2], np.float32))
    flags, _, _, rest = read(path)
    assert flags == HAS_COLORS | HAS_DISTANCES
    assert list(rest[:8]) == [3, 4, 5, 255, 4, 5, 6, 255]
    assert np.frombuffer(rest[8:], "<f4").tolist() == [0.5, 2]


def test_a_cloud_without_finite_points_is_empty(tmp_path: Path) -> None:
    path = tmp_path / "preview.bin"
    cloud = DecodedCloud(np.full((3, 3), np.nan), "xyz")
    write_preview(path, cloud, choose_rows(cloud.points, 10))
    assert read(path)[:2] == (0, 3)
