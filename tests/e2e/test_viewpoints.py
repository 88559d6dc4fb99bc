"""Files of several scans, and lists of viewpoints, over HTTP and on the command line."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from mpe_core.geometry.rigid import apply, axis_rotation, inverse
from service.formats import write_ply
from tests.e2e.test_cli_options import aligned
from tests.e2e.test_options import npz, result_of, submitted
from tests.factories.checks import assert_pose_close
from tests.factories.clouds import motion
from tests.factories.scanner_files import e57_of, ptx_of
from tests.factories.server import Server
from tests.factories.worlds import MergedScan, rooms, scan_rooms

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Pair:
    """Scans of two rooms, twice; those of the source were turned and moved together."""

    source: MergedScan
    target: MergedScan
    truth: Array

    @property
    def options(self) -> dict[str, Any]:
        """The places of both."""
        return {
            "source_viewpoint": self.source.viewpoints.tolist(),
            "target_viewpoint": self.target.viewpoints.tolist(),
        }


@pytest.fixture(scope="module")
def pair() -> Pair:
    rng = np.random.default_rng(5)
    world = rooms(rng, 2)
    source, target = (scan_rooms(world, rng, range(2)) for _ in range(2))
    away = motion(source.points, axis_rotation(np.array([0.1, 0.2, 1.0]), 2.0), rng)
    moved = tuple(apply(away, scan)[: len(scan) // 4 * 4] for scan in source.scans)
    return Pair(MergedScan(moved, apply(away, source.viewpoints)), target, inverse(away))


def check(result: dict[str, Any], pair: Pair) -> None:
    """The pose is right and sure."""
    T = np.array(result["transform"])
    assert_pose_close(T, pair.truth, pair.source.points, degrees=0.5, shift=0.01)
    assert result["accepted"]
    assert result["confidence"] > 0.99


def test_files_of_several_scans_tell_all_places(server: Server, pair: Pair) -> None:
    source = ptx_of(pair.source.scans, pair.source.viewpoints)
    target = e57_of(pair.target.scans, pair.target.viewpoints)
    told = result_of(submitted(server, source, target))
    check(told, pair)
    (said,) = [text for text in told["warnings"] if "the files tell" in text["message"]]
    assert said["message"].count("and 1 other in the") == 2
    blind = result_of(
        submitted(
            server, source, target, {"ignore_file_viewpoints": True, "infer_viewpoints": "never"}
        )
    )
    assert not [text for text in blind["warnings"] if "the files tell" in text["message"]]
    assert blind["confidence"] < told["confidence"]
    clouds = npz(pair.source.points), npz(pair.target.points)
    given = result_of(submitted(server, *clouds, pair.options))
    check(given, pair)
    assert given["confidence"] == pytest.approx(told["confidence"], abs=0.01)


def test_lists_come_back_and_a_list_of_one_is_the_same_work(server: Server, pair: Pair) -> None:
    clouds = npz(pair.source.points), npz(pair.target.points)
    job = submitted(server, *clouds, pair.options)
    assert job["options"] == job["options"] | pair.options
    check(result_of(job), pair)
    one = {"source_viewpoint": [1, 2, 3], "target_viewpoint": [[4, 5, 6]]}
    first = submitted(server, *clouds, one)
    again = submitted(server, *clouds, one | {"source_viewpoint": [[1, 2, 3]]})
    assert first["options"]["target_viewpoint"] == [4, 5, 6]
    assert again["cached"]


def test_places_are_repeated_arguments(
    pair: Pair, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words: list[object] = []
    for role, scan in (("source", pair.source), ("target", pair.target)):
        write_ply(tmp_path / f"{role}.ply", scan.points)
        words.append(tmp_path / f"{role}.ply")
        for place in scan.viewpoints:
            words += [f"--{role}-viewpoint", *place]
    check(aligned(capsys, *words), pair)


def test_distances_have_a_sign_by_the_nearest_place(server: Server, pair: Pair) -> None:
    clouds = npz(pair.source.points), npz(pair.target.points)
    job = submitted(server, *clouds, pair.options)
    found = server.client.get(f"/v1/registrations/{job['id']}/deviation").json()
    assert found["signed"]
    assert abs(found["mean"]) < 0.01
