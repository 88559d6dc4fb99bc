"""Range images: what is hidden is told by all points, and each direction by one viewpoint."""

import numpy as np

from mpe_core.geometry.range_image import RangeImage


def wall(x: float) -> np.ndarray:
    """A wall across the x axis, 4 by 4 metres, seen at 2 cm."""
    y, z = np.meshgrid(*[np.linspace(-2, 2, 201)] * 2)
    return np.column_stack([np.full(y.size, x), y.ravel(), z.ravel()])


def test_a_point_is_compared_with_what_its_nearest_viewpoint_saw():
    image = RangeImage(np.vstack([wall(3.0), wall(8.0)]), np.array([[0.0, 0, 0], [6.0, 0, 0]]))
    ranges, seen, is_seen = image.look_up(np.array([[1.0, 0, 0], [7.0, 0, 0], [9.5, 0, 0]]))
    np.testing.assert_allclose(ranges, [1, 1, 3.5])
    # both walls stand where the second viewpoint is nearer, or as near
    np.testing.assert_allclose(seen[1:], [2, 2], atol=0.01)
    assert is_seen[1:].all()


def test_what_stands_beyond_the_next_viewpoint_tells_nothing_of_the_way_to_it():
    """The first scanner, of a short range, never measured the wall that the second one did."""
    both = RangeImage(wall(20.0), np.array([[0.0, 0, 0], [17.0, 0, 0]]))
    between = np.array([[5.0, 0, 0]])
    assert not both.look_up(between)[2].any()
    assert RangeImage(wall(20.0), np.zeros((1, 3))).look_up(between)[2].all()


def test_a_viewpoint_without_points_near_it_saw_nothing():
    image = RangeImage(wall(3.0), np.array([[0.0, 0, 0], [-50.0, 0, 0]]))
    assert not image.look_up(np.array([[-60.0, 0, 0], [-40.0, 1, 0]]))[2].any()
