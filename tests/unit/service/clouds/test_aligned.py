"""Aligned files of large clouds are those of small ones, written in pieces."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from service.clouds.aligned import write_aligned
from service.formats import (
    DecodedCloud,
    ReadLimits,
    decoded_cloud,
    read_pieces,
    read_points,
    write_cloud,
)
from tests.factories.rich_clouds import rich_cloud

T = np.array([[0.0, -1, 0, 5], [1, 0, 0, -7], [0, 0, 1, 2], [0, 0, 0, 1]])
Read = Callable[[], Iterator[DecodedCloud]]


def reads(path: Path, max_points: int) -> Read:
    return partial(read_pieces, path, ReadLimits(max_points=max_points), attributes=True)


@pytest.mark.parametrize("is_merged", [False, True])
@pytest.mark.parametrize(("source", "format"), [("ply", "las"), ("laz", "ply"), ("ply", "csv")])
def test_pieces_and_the_whole_give_the_same_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, source: str, format: str, *, is_merged: bool
) -> None:
    monkeypatch.setattr(decoded_cloud, "PIECE_BYTES", 3000)
    cloud = replace(rich_cloud(), faces=None)
    write_cloud(tmp_path / "source", source, cloud)
    write_cloud(tmp_path / "target", "ply", cloud)
    found = []
    for max_points in (10**6, 20):
        clouds = [reads(tmp_path / name, max_points) for name in ("source", "target")]
        out = tmp_path / f"{max_points}"
        write_aligned(out, format, T, (), clouds[0], clouds[1] if is_merged else None)
        found.append(read_points(out, attributes=True))
    whole, pieces = found
    np.testing.assert_allclose(pieces.points, whole.points, atol=1e-6)
    assert set(pieces.attributes) == set(whole.attributes)
    for name, column in whole.attributes.items():
        np.testing.assert_allclose(pieces.attributes[name], column, atol=1e-6, err_msg=name)


NAMES = {"ply": "scalar_distance", "pcd": "distance", "las": "distance", "csv": "distance"}


@pytest.mark.parametrize(("format", "name"), NAMES.items())
@pytest.mark.parametrize("max_points", [10**6, 20])
def test_distances_are_an_attribute_of_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, format: str, name: str, max_points: int
) -> None:
    monkeypatch.setattr(decoded_cloud, "PIECE_BYTES", 3000)
    cloud = replace(rich_cloud(), faces=None)
    write_cloud(tmp_path / "cloud", "ply", cloud)
    read = reads(tmp_path / "cloud", max_points)
    target = read if max_points > 20 else None
    write_aligned(
        tmp_path / "out", format, T, (), read, target, lambda points: points[:, 2] - 100.0
    )
    found = read_points(tmp_path / "out", attributes=True)
    count = len(cloud.points)
    heights = found.points[:count, 2] - 100.0
    np.testing.assert_allclose(found.attributes[name][:count], heights, atol=0.06)  # LAS rounds
    assert np.isnan(found.attributes[name][count:].astype(float)).all()


def test_an_attribute_of_that_name_is_replaced_and_named(tmp_path: Path) -> None:
    points = rich_cloud().points
    cloud = DecodedCloud(points, "ply", attributes={"distance": np.ones(len(points))})
    write_cloud(tmp_path / "cloud", "npy", cloud)
    read = reads(tmp_path / "cloud", 10**6)
    warnings = write_aligned(
        tmp_path / "out", "npy", T, (), read, None, lambda points: 2 * np.ones(len(points))
    )
    assert any("'distance'" in text for text in warnings)
    assert (read_points(tmp_path / "out", attributes=True).attributes["distance"] == 2).all()
