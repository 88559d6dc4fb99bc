"""A place from which a scan hides nothing of itself stands for the scanner's."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from mpe_core import RegistrationOptions, register
from mpe_core.clouds.full_sight import FullSight, find_full_sight
from mpe_core.clouds.ground import find_ground
from mpe_core.clouds.normalize import robust_radius
from mpe_core.clouds.preprocess import prepare_cloud
from mpe_core.geometry.rigid import apply, rotation_error
from tests.factories.clouds import bunny, motion, points_of, random_rotation, real_pair
from tests.factories.worlds import scan_world, street

Array = NDArray[np.float64]


def look(points: Array) -> tuple[FullSight | None, Array, float]:
    """What is found, its place in the frame of the points, and their radius."""
    centre = points.mean(axis=0)
    radius = robust_radius(points, centre)
    surface = prepare_cloud((points - centre) / radius).surface
    sight = find_full_sight(surface, find_ground(surface.points))
    return sight, centre + radius * (np.zeros(3) if sight is None else sight.place), radius


@pytest.mark.parametrize("seed", range(3))
def test_the_scanner_of_a_street_is_found(seed: int) -> None:
    rng = np.random.default_rng(seed)
    scan = scan_world(street(rng), np.array([6.0, 1.0, 1.8]), rng)
    away = motion(scan.points, random_rotation(rng), rng)
    sight, place, radius = look(apply(away, scan.points))
    assert sight is not None
    assert sight.certainty > 0.97
    # the scanner stood at the origin of its scan; what it saw is seen from some way around, too
    assert np.linalg.norm(place - away[:3, 3]) < 0.25 * radius


@pytest.mark.parametrize("station", ["scan000", "scan003", "scan006"])
def test_thinned_scans_of_a_terrestrial_scanner_have_a_place(data: Path, station: str) -> None:
    points = points_of(data / "scenes/tls_promenade" / f"{station}.ply")
    sight, place, radius = look(points)
    assert sight is not None
    assert sight.certainty > 0.98
    assert np.linalg.norm(place) < 0.3 * radius  # the files' origins are the scanner's places


def test_scans_from_above_and_whole_models_have_none(data: Path) -> None:
    for points in (points_of(data / "scenes/als_city/s706_w.ply"), bunny(data)):
        assert look(points)[0] is None


def test_places_settle_what_slides_and_are_told_unless_unwanted(data: Path) -> None:
    trial = real_pair(data / "scenes", "tls_promenade_scan006_scan001", seed=1)
    never = register(trial.source, trial.target, RegistrationOptions(infer_viewpoints="never"))
    assert not never.accepted
    assert "viewpoints_inferred" not in [each.code for each in never.warnings]
    found = register(trial.source, trial.target)
    assert found.accepted
    (notice,) = (each for each in found.warnings if each.code == "viewpoints_inferred")
    assert "% of the source's points" in notice
    assert rotation_error(found.T_target_source, trial.T_target_source) < 0.3
    at = found.T_target_source @ np.linalg.inv(trial.T_target_source)
    assert np.linalg.norm(apply(at, trial.target[:1]) - trial.target[:1]) < 0.3  # of 60 m
