"""Colour and intensity come along from files of every format."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from service.formats import DecodedCloud, ReadLimits, common_brightness, read_surface, write_cloud
from service.formats.brightness import find_brightness
from service.storage.decoded_cache import load_or_decode

POINTS = np.random.default_rng(0).uniform(-1, 1, (60, 3))
RED = np.arange(60, dtype=np.uint8)
CLOUD = DecodedCloud(
    POINTS,
    "ply",
    attributes={
        **dict.fromkeys(("red", "green", "blue"), RED),
        "intensity": np.arange(60, dtype=np.uint16) * 100,
        "label": np.zeros(60, np.uint8),
    },
)


@pytest.mark.parametrize("format", ["ply", "pcd", "las", "e57", "csv", "npy"])
def test_files_bring_both(tmp_path: Path, format: str) -> None:
    write_cloud(tmp_path / "cloud", format, CLOUD)
    found = read_surface(tmp_path / "cloud")
    assert set(found.brightness) == {"color", "intensity"}
    for values in found.brightness.values():
        assert np.corrcoef(values, RED)[0, 1] > 0.999
    assert found.attributes == {}
    assert not any("not kept" in text for text in found.warnings)


def test_the_kind_that_both_have_counts() -> None:
    both = DecodedCloud(POINTS, "ply", brightness=find_brightness(CLOUD.attributes))
    scan = DecodedCloud(POINTS, "e57", brightness={"intensity": RED.astype(np.float32)})
    plain = DecodedCloud(POINTS, "xyz")
    values, others = common_brightness(both, scan)
    np.testing.assert_array_equal(values, both.brightness["intensity"])
    np.testing.assert_array_equal(others, RED)
    np.testing.assert_array_equal(common_brightness(both, both)[0], RED)
    assert common_brightness(both, plain) == (None, None)


def test_samples_of_a_mesh_have_the_brightness_of_their_place(tmp_path: Path) -> None:
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    shades = {name: np.array([0, 200, 200, 0], np.uint8) for name in ("red", "green", "blue")}
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    write_cloud(
        tmp_path / "mesh", "ply", DecodedCloud(square, "ply", attributes=shades, faces=faces)
    )
    found = read_surface(tmp_path / "mesh", surface_samples=500)
    np.testing.assert_allclose(found.brightness["color"], 200 * found.points[:, 0], atol=1e-3)


def test_the_cache_of_decoded_clouds_keeps_it(tmp_path: Path) -> None:
    cloud = DecodedCloud(POINTS, "ply", brightness=find_brightness(CLOUD.attributes))
    entry = tmp_path / "entry.npz"
    load_or_decode(entry, lambda: cloud, tmp_path, ReadLimits())
    kept = load_or_decode(entry, lambda: pytest.fail("decoded again"), tmp_path, ReadLimits())
    for kind, values in cloud.brightness.items():
        np.testing.assert_array_equal(kept.brightness[kind], values)
