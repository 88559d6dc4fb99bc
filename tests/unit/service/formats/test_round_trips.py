"""From every format that is read to every one that is written: nothing is lost in silence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from service.clouds.transform import transform_cloud
from service.formats import WRITERS, DecodedCloud, UnsupportedFileError, read_points, write_cloud
from service.formats.colors import find_colors, unpack_colors
from tests.factories.array_files import array_seeds
from tests.factories.cloud_files import seeds
from tests.factories.decoding import write_file
from tests.factories.rich_clouds import rich_cloud
from tests.factories.scanner_files import scanner_seeds

SOURCES = {**seeds(), **scanner_seeds(), **array_seeds()}
Columns = dict[str, NDArray[np.generic]]
STEP = 6e-4
"""Of the coordinates in LAS, and of single precision far from zero."""


def table(cloud: DecodedCloud) -> Columns:
    """The attributes, colours in 8 bits, normals among them."""
    columns = unpack_colors(cloud.attributes)
    if (colors := find_colors(columns)) is not None:
        columns |= dict(zip(colors.names, colors.to_8_bits().T, strict=True))
    if cloud.normals is not None:
        columns |= dict(zip(("nx", "ny", "nz"), cloud.normals.T, strict=True))
    return columns


def holds(columns: Columns, wanted: NDArray[np.generic]) -> bool:
    """Whether a column has the same numbers, up to single precision."""
    numbers = wanted.astype(float)
    return any(
        column.shape == wanted.shape
        and np.allclose(column.astype(float), numbers, rtol=1e-6, atol=3e-3, equal_nan=True)
        for column in columns.values()
    )


def assert_kept_or_told(
    cloud: DecodedCloud, found: DecodedCloud, warnings: tuple[str, ...]
) -> None:
    told = " ".join(warnings + found.warnings)
    if found.format == "stl":  # has triangles, and no points of its own
        assert found.faces is not None
        assert cloud.faces is not None
        corners, expected = found.points[found.faces], cloud.points[cloud.faces]
        np.testing.assert_allclose(corners, expected, rtol=1e-6, atol=STEP)
    else:
        np.testing.assert_allclose(found.points, cloud.points, rtol=1e-6, atol=STEP)
        kept = found.faces is not None and np.array_equal(found.faces, cloud.faces)
        assert kept or cloud.faces is None or "faces" in told
    columns = table(found)
    for name, column in table(cloud).items():
        is_told = repr(name) in told or f"'_{name}'" in told
        is_told |= name.startswith(("nx", "ny", "nz", "normal")) and "normals are scaled" in told
        assert holds(columns, column) or is_told, (name, told, list(columns))


@pytest.mark.parametrize("source", [*SOURCES, "rich"])
def test_attributes_are_kept_or_named(tmp_path: Path, source: str) -> None:
    cloud = rich_cloud()
    if source != "rich":
        cloud = read_points(write_file(tmp_path, SOURCES[source]), attributes=True)
    cloud = transform_cloud(cloud, np.eye(4))  # puts the normals among the attributes
    for format in WRITERS:
        path = tmp_path / f"a.{format}"
        if format == "stl" and cloud.faces is None:
            with pytest.raises(UnsupportedFileError):
                write_cloud(path, format, cloud)
            continue
        warnings = write_cloud(path, format, cloud)
        assert_kept_or_told(cloud, read_points(path, attributes=True), warnings)
