"""Intensity or colour settles what the surfaces leave free, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from mpe_core import CloudShapeError, RegistrationOptions, register
from mpe_core.clouds.validate import validate_cloud
from mpe_core.color_search import settle_by_color
from mpe_core.geometry.rigid import apply, inverse, pose
from mpe_core.progress import Progress
from mpe_core.rigid_registration import register_rigidly
from tests.factories.clouds import knot, random_rotation
from tests.factories.painted import paint, road, tube, wall


def scanned(painted, rng, gain=1.0, offset=0.0):
    """Points and brightness as another scanner sees them, with noise."""
    points, brightness = painted
    return points, gain * (brightness + rng.normal(0, 0.05, len(points))) + offset


def moved(points, rng):
    truth = pose(random_rotation(rng), rng.uniform(-2, 2, 3))
    return apply(inverse(truth), points)


@pytest.mark.parametrize(
    ("make", "most"), [("wall", 0.02), ("road", 0.1), ("tube", 0.02)], ids=["wall", "road", "tube"]
)
def test_a_pattern_settles_what_slides(make, most):
    rng = np.random.default_rng(1)
    pattern = paint(rng)
    first, second = {
        "wall": lambda: (wall(rng, pattern, 0), wall(rng, pattern, 1.5)),
        "road": lambda: (road(rng, 0), road(rng, 8)),
        "tube": lambda: (tube(rng, 0), tube(rng, 4)),
    }[make]()
    there, light = scanned(first, rng)
    target, other_light = scanned(second, rng, gain=60, offset=-400)
    source = moved(there, rng)
    found = register(source, target, source_colors=light, target_colors=other_light)
    off = np.linalg.norm(apply(found.T_target_source, source) - there, axis=1)
    assert found.accepted
    assert np.sqrt(np.square(off).mean()) < most
    assert len(found.free_directions) == 0
    codes = [warning.code for warning in found.warnings]
    assert "settled_by_color" in codes
    assert "free_directions" not in codes
    assert np.linalg.eigvalsh(found.covariance)[-1] < 1
    across = np.abs((apply(found.T_target_source, source) - there) @ [0, 0, 1])
    assert make == "tube" or np.median(across) < 0.005  # the surfaces settle what they can


def test_no_free_space_is_told_from_what_brightness_raises():
    """From a place of full sight over the relief of a road, a wrong pose looked better."""
    rng = np.random.default_rng(7)
    first, second = road(rng, 0), road(rng, rng.uniform(2, 8))
    there, light = scanned(first, rng)
    source = moved(there, rng)
    found = register(source, second[0], source_colors=light, target_colors=60 * second[1] - 400)
    assert found.accepted
    off = np.linalg.norm(apply(found.T_target_source, source) - there, axis=1)
    assert np.sqrt(np.square(off).mean()) < 0.1  # of thirty metres


def test_unlike_patterns_settle_nothing():
    rng = np.random.default_rng(2)
    there, light = scanned(wall(rng, paint(rng), 0, 2000), rng)
    target, other_light = scanned(wall(rng, paint(rng), 0, 2000), rng)
    source = moved(there, rng)
    found = register(source, target, source_colors=light, target_colors=other_light)
    assert len(found.free_directions) == 3
    assert all(warning.code != "settled_by_color" for warning in found.warnings)


def test_colors_of_one_cloud_or_on_request_are_not_looked_at():
    rng = np.random.default_rng(3)
    points, light = scanned(wall(rng, paint(rng), 0, 2000), rng)
    cloud, plain = validate_cloud(points, colors=light), validate_cloud(points)
    options = RegistrationOptions()
    first = register_rigidly(cloud, plain, options, Progress(None))
    assert len(first.found.free_directions) == 3
    assert settle_by_color(first, options, Progress(None)) is first
    both = replace(first, pair=replace(first.pair, target_cloud=cloud))
    never = RegistrationOptions(use_color="never")
    assert settle_by_color(both, never, Progress(None)) is both


def test_what_the_surfaces_settle_is_bit_for_bit_the_same():
    rng = np.random.default_rng(4)
    there, target = knot(3000, rng), knot(3000, rng)
    source = moved(there, rng)
    found = register(source, target, source_colors=there, target_colors=rng.random((3000, 3)))
    plain = register(source, target)
    np.testing.assert_array_equal(found.T_target_source, plain.T_target_source)
    np.testing.assert_array_equal(found.covariance, plain.covariance)


def test_colors_need_a_number_or_three_for_each_point():
    cloud = knot(100, np.random.default_rng(0))
    for wrong in (np.ones(99), np.ones((100, 2)), ["red"] * 100):
        with pytest.raises(CloudShapeError, match="colors"):
            register(cloud, cloud, source_colors=wrong)
