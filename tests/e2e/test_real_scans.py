"""Real scans through the running service, checked against their known poses."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.factories.scans import Points, Pose, as_npy, motion, moved, pair, points, pose_error
from tests.factories.server import Server

pytestmark = pytest.mark.real_data


def register(server: Server, source: bytes, target: bytes) -> dict[str, Any]:
    response = server.submit(source, target, wait=60)
    assert response.status_code == 200, response.text
    job: dict[str, Any] = response.json()
    assert job["status"] == "succeeded", job["error"]
    return job


def check(
    job: dict[str, Any], truth: Pose, source: Points, *, degrees: float, shift: float
) -> None:
    start = pose_error(np.eye(4), truth, source)
    assert start[0] > degrees or start[1] > shift, "the start itself would pass"
    found = pose_error(np.array(job["result"]["transform"]), truth, source)
    assert found[0] < degrees, found
    assert found[1] < shift, found


def test_bunny_turned_by_ninety_degrees(server: Server, data: Path) -> None:
    target = points(data / "bunny_whole" / "bun_zipper_res3.ply")
    diagonal = float(np.linalg.norm(np.ptp(target, axis=0)))
    truth = motion(np.random.default_rng(1), target, 90, diagonal / 2)
    source = moved(np.linalg.inv(truth), target)
    job = register(server, as_npy(source), as_npy(target))
    check(job, truth, source, degrees=0.1, shift=1e-3 * diagonal)
    assert job["result"]["inliers"]["ratio"] > 0.99


def test_stanford_scans_as_they_were_scanned(server: Server, data: Path) -> None:
    entry = pair(data, "bun045_bun000")
    source = points(data / entry["source"])
    truth = np.array(entry["T_target_source"])
    assert pose_error(np.eye(4), truth, source)[0] < 40
    job = register(
        server,
        (data / entry["source"]).read_bytes(),
        (data / entry["target"]).read_bytes(),
    )
    check(
        job,
        truth,
        source,
        degrees=entry["max_rotation_deg"],
        shift=entry["max_translation"],
    )
    assert job["result"]["rmse"] < entry["overlap_radius"]


def test_kitti_scans_as_they_were_driven(server: Server, data: Path) -> None:
    entry = pair(data, "kitti")
    source = points(data / entry["source"])
    job = register(
        server, (data / entry["source"]).read_bytes(), (data / entry["target"]).read_bytes()
    )
    check(
        job,
        np.array(entry["T_target_source"]),
        source,
        degrees=entry["max_rotation_deg"],
        shift=entry["max_translation"],
    )
