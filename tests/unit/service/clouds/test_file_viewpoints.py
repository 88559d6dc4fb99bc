"""The scanners' positions that files tell are used, unless the caller says otherwise."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mpe_core.options import RegistrationOptions
from service.clouds.file_viewpoints import with_file_viewpoints
from service.formats import read_points
from service.formats.decoded_cloud import UNMOVED, DecodedCloud, ReadLimits
from tests.factories.cloud_files import pcd
from tests.factories.decoding import decode, write_file
from tests.factories.scanner_files import MOVE, QUARTER_TURN, STEP, e57, kitti, ptx


def rows_of_kitti(folder: Path) -> DecodedCloud:
    return read_points(write_file(folder, kitti()), format="kitti")


@pytest.mark.parametrize("file", [e57, ptx])
def test_each_scan_tells_where_it_was_measured(tmp_path: Path, file) -> None:
    cloud = decode(tmp_path, file())
    np.testing.assert_allclose(cloud.scanner_positions, [MOVE])
    w, x, y, z = cloud.viewpoints[0][3:]
    # a quarter turn about z, as the points of the file are turned
    np.testing.assert_allclose(np.abs([w, x, y, z]), [np.sqrt(0.5), 0, 0, np.sqrt(0.5)], atol=1e-9)
    assert np.sign(w * z) == np.sign(QUARTER_TURN[1, 0])
    two = write_file(tmp_path, file(scans=2))
    np.testing.assert_allclose(read_points(two).scanner_positions, [MOVE, MOVE + STEP])
    np.testing.assert_allclose(read_points(two, scan=1).scanner_positions, [MOVE + STEP])
    thinned = read_points(two, ReadLimits(max_points=30))
    assert thinned.rows is not None
    np.testing.assert_allclose(thinned.scanner_positions, [MOVE, MOVE + STEP])


@pytest.mark.parametrize("file", [e57, ptx])
def test_several_scans_of_one_pose_tell_nothing(tmp_path: Path, file) -> None:
    """Their points were moved into one frame before they were written."""
    merged = write_file(tmp_path, file(scans=2, step=(0.0, 0.0, 0.0)))
    assert read_points(merged).scanner_positions == ()
    np.testing.assert_allclose(read_points(merged, scan=1).scanner_positions, [MOVE])


def test_the_places_of_all_scans_are_used_up_to_a_number(tmp_path: Path) -> None:
    source, target = decode(tmp_path, ptx(scans=5)), decode(tmp_path, e57(scans=2))
    options, said = with_file_viewpoints(RegistrationOptions(), source, target)
    np.testing.assert_allclose(options.source_viewpoint, MOVE + np.arange(5)[:, None] * STEP)
    np.testing.assert_allclose(options.target_viewpoint, [MOVE, MOVE + STEP])
    assert "(10, 20, 30) and 4 others in the source" in said[0]
    assert "(10, 20, 30) and 1 other in the target" in said[0]
    many = replace(target, viewpoints=tuple((float(n), 0, 0, 1, 0, 0, 0) for n in range(257)))
    assert with_file_viewpoints(RegistrationOptions(), source, many) == (RegistrationOptions(), ())


def test_the_default_of_pcd_tells_nothing(tmp_path: Path) -> None:
    told = decode(tmp_path, pcd())
    assert told.scanner_positions == ((1, 2, 3),)
    assert replace(told, viewpoints=(UNMOVED,)).scanner_positions == ()
    assert rows_of_kitti(tmp_path).scanner_positions == ((0, 0, 0),)


def test_both_are_used_and_said_unless_the_caller_says_otherwise(tmp_path: Path) -> None:
    source, target = decode(tmp_path, pcd()), rows_of_kitti(tmp_path)
    options, said = with_file_viewpoints(RegistrationOptions(), source, target)
    assert (options.source_viewpoint, options.target_viewpoint) == ((1, 2, 3), (0, 0, 0))
    assert "(1, 2, 3) in the source and (0, 0, 0) in the target" in said[0]
    own = RegistrationOptions(source_viewpoint=(0, 0, 9), target_viewpoint=(0, 0, 8))
    for given in (
        own,
        RegistrationOptions(ignore_file_viewpoints=True),
        RegistrationOptions(method="mpe"),
    ):
        assert with_file_viewpoints(given, source, target) == (given, ())
    blind = replace(target, viewpoints=())
    assert with_file_viewpoints(RegistrationOptions(), source, blind)[1] == ()
