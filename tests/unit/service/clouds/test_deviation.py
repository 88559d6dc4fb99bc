"""Distances have a sign where the target tells its outside."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from service.clouds.deviation import build_surface
from service.formats import DecodedCloud, read_points, read_surface, write_cloud, write_ply

OVER, UNDER = (0.0, 0.0, 9.0, 1.0, 0.0, 0.0, 0.0), (0.0, 0.0, -10.0, 1.0, 0.0, 0.0, 0.0)
ABOVE = np.array([[0.0, 0.0, 0.1], [0.0, 0.0, -0.1]])


@pytest.mark.parametrize(
    ("told", "given", "ignores_file", "is_signed"),
    [
        ((), None, False, False),
        ((OVER,), None, False, True),
        ((OVER,), None, True, False),
        ((UNDER,), [0.0, 0.0, 9.0], False, True),
        ((UNDER, OVER, OVER), None, False, True),
        ((), [[9.0, 9.0, -9.0], [0.0, 0.0, 9.0]], False, True),
    ],
)
def test_the_position_that_the_file_tells_counts_unless_the_caller_says_otherwise(
    tmp_path: Path,
    told: tuple[tuple[float, ...], ...],
    given: list[Any] | None,
    ignores_file: bool,
    is_signed: bool,
) -> None:
    x, y = np.random.default_rng(0).uniform(-1, 1, (2, 500))
    write_ply(tmp_path / "plane.ply", np.column_stack([x, y, 0 * x]))
    plane = replace(read_points(tmp_path / "plane.ply"), viewpoints=told)
    surface = build_surface(plane, given, ignores_file=ignores_file)
    expected = [0.1, -0.1] if is_signed else [0.1, 0.1]
    np.testing.assert_allclose(surface.measure(ABOVE), expected, atol=1e-6)


def test_distances_from_a_sampled_mesh_are_those_from_its_triangles(tmp_path: Path) -> None:
    corners = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    square = DecodedCloud(corners, "ply", faces=np.array([[0, 1, 2], [0, 2, 3]]))
    write_cloud(tmp_path / "square", "ply", square)
    surface = build_surface(read_surface(tmp_path / "square"), None, ignores_file=False)
    assert surface.is_signed
    beside = np.array([[4.0, 5.0, 0.0]])
    found = surface.measure(np.concatenate([ABOVE, beside]))
    np.testing.assert_allclose(found, [0.1, -0.1, 5.0], rtol=0, atol=1e-12)
