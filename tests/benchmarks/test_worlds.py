"""Generated worlds: their truth is true, and their scanners see what is in sight."""

import numpy as np
import pytest

pytest.importorskip("open3d")
from scipy.spatial import KDTree

from benchmarks.worlds.families import FAMILIES
from benchmarks.worlds.pairs import foreign_pair, foreign_pairs, world_pair, world_pairs
from benchmarks.worlds.scanners import terrestrial
from benchmarks.worlds.scene import Scene
from mpe_core import register
from mpe_core.assess.free_space import FreeSpace
from mpe_core.geometry.rigid import apply
from tests.factories.checks import assert_pose_close


@pytest.fixture(scope="module")
def pairs():
    return {pair.family: pair for pair in world_pairs(1)}


def test_there_is_a_pair_of_each_family_that_overlaps(pairs):
    assert set(pairs) == set(FAMILIES)
    for pair in pairs.values():
        assert 0.05 < pair.overlap <= 1, pair.name
        assert min(len(pair.source), len(pair.target)) > 1000, pair.name


def test_the_true_pose_lays_the_scans_on_each_other(pairs):
    for pair in pairs.values():
        tree = KDTree(pair.target)
        radius = pair.max_translation
        at_truth = np.isfinite(
            tree.query(apply(pair.T_target_source, pair.source), distance_upper_bound=radius)[0]
        ).mean()
        untouched = np.isfinite(tree.query(pair.source, distance_upper_bound=radius)[0]).mean()
        assert at_truth > 1.5 * untouched, pair.name


def test_no_scan_stands_in_the_free_space_of_the_other_at_the_true_pose(pairs):
    for pair in pairs.values():
        if pair.source_viewpoint is None:
            continue
        clouds = pair.source, pair.target
        unit = min(np.quantile(np.linalg.norm(x - x.mean(0), axis=1), 0.98) for x in clouds)
        points = ((x / unit).astype(np.float32) for x in clouds)
        places = pair.source_viewpoint[None] / unit, pair.target_viewpoint[None] / unit
        space = FreeSpace(*points, *places)
        T = pair.T_target_source.copy()
        T[:3, 3] /= unit
        assert space.violation(T) < 0.1, pair.name


def test_two_worlds_of_a_kind_have_no_pose():
    pair = next(iter(foreign_pairs(1)))
    assert pair.T_target_source is None
    assert pair.overlap == 0


def test_the_same_pair_is_made_again(pairs):
    again = next(iter(world_pairs(1)))
    np.testing.assert_array_equal(again.source, pairs[again.family].source)


def test_a_box_hides_what_is_behind_it():
    scene = Scene()
    scene.box((5, 0, 0), (1, 4, 4))
    scene.box((8, 0, 0), (1, 2, 2))
    scan = terrestrial(scene, np.zeros(3), np.random.default_rng(0))
    ahead = apply(scan.T_world_scan, scan.points)
    # 3 mm of noise
    assert ahead[:, 0].min() == pytest.approx(4.5, abs=0.02)
    assert ahead[:, 0].max() < 5.6


@pytest.mark.parametrize(
    ("family", "number"),
    [
        ("room_stations", 19005),  # a floor that does not stand out, searched levelled
        ("room_frames", 19005),  # the best pose is on its way when its steps run out
        ("statue", 20500),  # a seventh is shared, which coarse cells do not tell
    ],
)
def test_worlds_that_were_wrong_are_right(family, number):
    pair = world_pair(family, number)
    found = register(pair.source, pair.target)
    assert found.accepted
    assert_pose_close(
        found.T_target_source,
        pair.T_target_source,
        pair.source,
        degrees=pair.max_rotation_deg,
        shift=pair.max_translation,
    )


@pytest.mark.parametrize("number", [18206, 19001, 19502])
def test_different_cartons_are_refused(number):
    """Their flat sides lie on each other at several poses, at 0.9 and more of the points."""
    pair = foreign_pair("cartons", number)
    found = register(pair.source, pair.target)
    assert not found.accepted
    assert {"low_confidence", "ambiguous"} <= {warning.code for warning in found.warnings}
