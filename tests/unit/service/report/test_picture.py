"""Points are where they belong in a picture, nearer ones before farther ones."""

from __future__ import annotations

import struct
import zlib

import numpy as np
import pytest

from service.report.lettering import write_word
from service.report.picture import View, color_by_value, draw_points, encode_png, thin

FRONT = View(-90, 0)
RED, BLUE = np.array([255, 0, 0], np.uint8), np.array([0, 0, 255], np.uint8)


def test_axes_are_orthonormal_and_z_is_up() -> None:
    for azimuth in (-135, -45, 0, 60):
        axes = View(azimuth, 30).axes()
        np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
        assert axes[1, 2] > 0


def test_x_is_to_the_right_and_z_is_up_from_the_front() -> None:
    corners = np.array([[-1.0, 0, -1], [1, 0, -1], [-1, 0, 1], [1, 0, 1]])
    colors = np.array([[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 0]], np.uint8)
    image = draw_points(corners, colors, FRONT, (100, 100))
    where = {tuple(c): np.argwhere((image == c).all(axis=2)).mean(axis=0) for c in colors}
    lower_left, lower_right, upper_left, _ = (where[tuple(c)] for c in colors)
    assert lower_left[1] < 50 < lower_right[1]
    assert upper_left[0] < 50 < lower_left[0]


def test_the_nearer_point_hides_the_farther_one() -> None:
    near, far = [0.0, -1, 0], [0.0, 1, 0]
    spread = [[-1.0, 0, -1], [1, 0, 1]]
    for points, colors in (([near, far], [RED, BLUE]), ([far, near], [BLUE, RED])):
        image = draw_points(np.array(points), np.array(colors), FRONT, (60, 60), np.array(spread))
        assert (image[30, 30] == RED).all()


def test_nothing_to_draw_is_white() -> None:
    assert (draw_points(np.empty((0, 3)), np.empty((0, 3), np.uint8), FRONT, (8, 8)) == 255).all()
    one = draw_points(np.zeros((1, 3)), RED[None], FRONT, (20, 20))
    assert (one == RED).all(axis=2).any()


def test_colours_run_from_blue_to_red_and_nan_is_grey() -> None:
    low, middle, high, none = color_by_value(np.array([-9.0, 0, 9, np.nan]), -1, 1).astype(int)
    assert low[2] > low[0]
    assert middle[1] > max(middle[0], middle[2])
    assert high[0] > high[2]
    assert len(set(none)) == 1


def test_thinning_leaves_out_what_is_not_finite() -> None:
    points = np.zeros((10, 3))
    points[3] = np.nan
    assert list(thin(points)) == [0, 1, 2, 4, 5, 6, 7, 8, 9]


def test_a_png_holds_the_pixels() -> None:
    image = np.random.default_rng(0).integers(0, 256, (5, 7, 3)).astype(np.uint8)
    data = encode_png(image)
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    assert struct.unpack(">II", data[16:24]) == (7, 5)
    (length,) = struct.unpack(">I", data[33:37])
    rows = np.frombuffer(zlib.decompress(data[41 : 41 + length]), np.uint8).reshape(5, 22)
    np.testing.assert_array_equal(rows[:, 1:].reshape(5, 7, 3), image)


@pytest.mark.parametrize("word", ["BEFORE ISO", "AFTER FRONT", "BEFORE TOP", "SOURCE", "TARGET"])
def test_words_are_written(word: str) -> None:
    image = np.full((40, 300, 3), 255, np.uint8)
    assert write_word(image, word, 10, 10) < 300
    assert (image < 255).any()
