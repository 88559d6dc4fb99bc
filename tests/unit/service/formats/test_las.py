"""LAS and LAZ files of real tools and by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from service.formats import read_points

REAL = [
    ("formats/1.2-with-color.las", 1065, (3362.7, 4635.73, 179.79)),
    ("formats/autzen-thin.las", 10653, (3405.74, 4648.98, 187.14)),
]


@pytest.mark.real_data
@pytest.mark.parametrize(("name", "count", "extent"), REAL)
def test_files_of_real_tools(
    data: Path, name: str, count: int, extent: tuple[float, float, float]
) -> None:
    points = read_points(data / name).points
    assert points.shape == (count, 3)
    np.testing.assert_allclose(np.ptp(points, axis=0), extent, rtol=1e-5)
