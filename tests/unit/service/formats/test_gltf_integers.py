"""glTF whose positions and colours are stored as integers, as optimizers write them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from service.formats import UnsupportedFileError, read_points
from tests.factories.decoding import write_file
from tests.factories.gltf import glb_file, scene_of

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 1]])
TYPES = {np.dtype(name): number for name, number in
         (("i1", 5120), ("u1", 5121), ("<i2", 5122), ("<u2", 5123), ("<f4", 5126))}  # fmt: skip
Arrays = dict[str, NDArray[Any]]


def glb(*parts: Arrays, mode: int = 0, normalized: bool = True) -> bytes:
    """One mesh of parts, whose integers of one or two bytes are padded to multiples of four."""
    data, views, accessors, primitives = b"", [], [], []
    for part in parts:
        names = {}
        for name, array in part.items():
            rows = np.pad(array, ((0, 0), (0, -array.shape[1] % 4)))
            view = {"buffer": 0, "byteOffset": len(data), "byteLength": rows.nbytes}
            views.append(view | {"byteStride": rows.nbytes // len(rows)})
            is_fraction = array.dtype.kind != "f" and (normalized or name != "POSITION")
            accessors.append(
                {"bufferView": len(views) - 1, "componentType": TYPES[array.dtype]}
                | {"count": len(array), "type": f"VEC{array.shape[1]}", "normalized": is_fraction}
            )
            names[name] = len(accessors) - 1
            data += rows.tobytes()
        primitives.append({"attributes": names, "mode": mode})
    document = scene_of({"scale": [2, 2, 2], "translation": [5, 0, 0]}) | {
        "meshes": [{"primitives": primitives, "extras": {"largest integer": 7}}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(data)}],
    }
    return glb_file(document, data)


@pytest.mark.parametrize(("kind", "one"), [("i1", 127), ("<i2", 32767)])
def test_normalized_positions_are_fractions(tmp_path: Path, kind: str, one: int) -> None:
    stored = (CORNERS * one).astype(kind)
    for content in (glb({"POSITION": stored}), glb({"POSITION": stored[:3]}, mode=4)):
        points = read_points(write_file(tmp_path, content)).points
        np.testing.assert_allclose(points, (CORNERS * 2 + [5, 0, 0])[: len(points)], atol=1e-12)


@pytest.mark.parametrize("kind", ["i1", "u1", "<i2", "<u2", "<f4"])
def test_other_positions_are_as_they_are_stored(tmp_path: Path, kind: str) -> None:
    stored = np.abs(CORNERS * 100).astype(kind)
    cloud = read_points(write_file(tmp_path, glb({"POSITION": stored}, normalized=False)))
    np.testing.assert_array_equal(cloud.points, stored * 2.0 + [5, 0, 0])


def test_parts_of_unlike_positions_are_refused(tmp_path: Path) -> None:
    parts = [{"POSITION": CORNERS.astype(kind)} for kind in ("<f4", "<i2")]
    with pytest.raises(UnsupportedFileError, match="quantized in unlike ways"):
        read_points(write_file(tmp_path, glb(*parts)))


def test_colours_keep_their_bits(tmp_path: Path) -> None:
    points = CORNERS.astype("<f4")
    shares = np.tile([1.0, 0.5, 0.0, 1.0], (4, 1))
    colors = {
        "u1": np.floor(shares * 255).astype("u1"),
        "<u2": np.floor(shares * 65535).astype("<u2"),
        "<f4": shares.astype("<f4"),
    }
    expected = {"u1": [255, 127, 0], "<u2": [65535, 32767, 0], "<f4": [255, 128, 0]}
    for kind, stored in colors.items():
        for width in (3, 4):
            part = {"POSITION": points, "COLOR_0": stored[:, :width]}
            found = read_points(write_file(tmp_path, glb(part)), attributes=True)
            assert [found.attributes[name][0] for name in ("red", "green", "blue")] == expected[
                kind
            ]
            assert not found.warnings
    parts = [{"POSITION": points, "COLOR_0": colors[kind]} for kind in ("u1", "<u2")]
    found = read_points(write_file(tmp_path, glb(*parts)), attributes=True)
    np.testing.assert_array_equal(found.attributes["green"], [127 * 257] * 4 + [32767] * 4)
