"""Bright points are raised over the surface; what is uniform is not."""

import numpy as np
import pytest

from mpe_core.clouds.relief import HEIGHT, find_pattern
from tests.factories.painted import paint, tube, wall


def test_gain_and_offset_of_the_scanner_do_not_matter():
    rng = np.random.default_rng(0)
    points, brightness = wall(rng, paint(rng), -2, 5000)
    first, second = (find_pattern(points, each) for each in (brightness, 900 * brightness - 70))
    np.testing.assert_allclose(first.height, second.height, atol=1e-4)


def test_a_wall_is_raised_to_either_side_and_a_tube_outwards():
    rng = np.random.default_rng(0)
    sheet = find_pattern(*wall(rng, paint(rng), -2, 5000))
    up, down = sheet.raise_relief(1), sheet.raise_relief(-1)
    np.testing.assert_allclose((up + down) / 2, sheet.points, atol=1e-6)
    assert np.ptp(up[:, 2]) == pytest.approx(HEIGHT, rel=0.4)
    points, brightness = tube(rng, -6)
    pipe = find_pattern(points / 6, brightness)
    radius = np.linalg.norm(pipe.raise_relief(1)[:, 1:], axis=1)
    assert np.corrcoef(radius, pipe.height)[0, 1] > 0.98


@pytest.mark.parametrize("brightness", [np.full(500, 7.0), np.full(500, np.nan)])
def test_what_is_uniform_or_unknown_is_no_pattern(brightness):
    assert find_pattern(np.random.default_rng(0).normal(size=(500, 3)), brightness) is None
