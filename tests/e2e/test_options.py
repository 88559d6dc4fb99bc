"""What a caller knows makes a difference over HTTP; what makes no sense is told."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mpe_core.geometry.rigid import apply, axis_rotation, inverse, pose
from service.formats import write_ply
from tests.factories.checks import assert_pose_close, pose_error
from tests.factories.clouds import bunny, knot, motion, room, sheet, turned_over, with_passer
from tests.factories.server import Server, finished

Array = NDArray[np.float64]
UP = np.array([0.0, 0.0, 1.0])
SHIFT = np.array([0.02, -0.01, 0.015])
GOOD = knot(300, np.random.default_rng(1))


def npz(points: Array, **columns: NDArray[Any]) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, points=points, **columns)
    return buffer.getvalue()


def submitted(
    server: Server,
    source: bytes,
    target: bytes,
    options: dict[str, Any] | None = None,
    weights: dict[str, str] | None = None,
) -> dict[str, Any]:
    """The job when it has ended."""
    reading = {role: {"weights": name} for role, name in (weights or {}).items()}
    response = server.submit(
        source, target, options=json.dumps(options or {}), reading=json.dumps(reading)
    )
    assert response.is_success
    return finished(server.client, response.json()["id"])


def result_of(job: dict[str, Any]) -> dict[str, Any]:
    assert job["status"] == "succeeded", job["error"]
    result: dict[str, Any] = job["result"]
    return result


def turned_room(seed: int) -> tuple[Array, Array, Array]:
    """Two samplings of a room that one half turn lays on itself, and the motion between them."""
    rng = np.random.default_rng(seed)
    target, source = turned_over(room(rng)), turned_over(room(rng))
    away = motion(source, axis_rotation(UP, 2.0), rng)
    return apply(away, source), target, away


def gravity(away: Array) -> dict[str, Any]:
    return {"source_gravity": (-(away[:3, :3] @ UP)).tolist(), "target_gravity": [0, 0, -1]}


def levelled(_: Array) -> dict[str, Any]:
    return {"yaw_only": True}


def start(away: Array) -> dict[str, Any]:
    near = pose(axis_rotation(UP, np.radians(15)), 0.05 * UP)
    return {"initial_transform": (near @ inverse(away)).tolist()}


@pytest.mark.parametrize("knowledge", [gravity, levelled, start])
def test_what_is_known_chooses_among_equal_poses(
    server: Server, knowledge: Callable[[Array], dict[str, Any]]
) -> None:
    source, target, away = turned_room(0)
    found = result_of(submitted(server, npz(source), npz(target), knowledge(away)))
    assert result_of(submitted(server, npz(source), npz(target)))["ambiguous"]
    assert not found["ambiguous"]
    T = np.array(found["transform"])
    assert_pose_close(T, inverse(away), source, degrees=0.5, shift=0.01)
    if knowledge is levelled:
        np.testing.assert_allclose(T[:3, :3] @ UP, UP, atol=1e-12)


def test_viewpoints_settle_the_flip_of_a_thin_part(server: Server) -> None:
    rng = np.random.default_rng(0)
    target, source, seen_from = sheet(rng), sheet(rng), 3 * UP
    away = motion(source, axis_rotation(rng.normal(size=3), 2.2), rng)
    source = apply(away, source)
    options = {
        "source_viewpoint": apply(away, seen_from[None])[0].tolist(),
        "target_viewpoint": seen_from.tolist(),
    }
    assert result_of(submitted(server, npz(source), npz(target)))["ambiguous"]
    found = result_of(submitted(server, npz(source), npz(target), options))
    assert not found["ambiguous"]
    T = np.array(found["transform"])
    assert_pose_close(T, inverse(away), source, degrees=1, shift=0.01)


def test_the_result_says_how_exact_it_is(server: Server) -> None:
    """A pose's error is a few of its standard deviations; a plane slides and turns in itself."""
    rng = np.random.default_rng(4)
    target, source = knot(2000, rng), knot(2000, rng)
    away = motion(source, axis_rotation(UP, 0.4), rng)
    source = apply(away, source)
    found = result_of(submitted(server, npz(source), npz(target)))
    assert found["free_directions"] == []
    covariance = np.array(found["covariance"])
    np.testing.assert_allclose(covariance, covariance.T, rtol=0, atol=1e-9 * covariance.max())
    left = np.array(found["transform"]) @ away
    spread = np.sqrt(np.trace(covariance[:3, :3]))
    angle = np.linalg.norm(Rotation.from_matrix(left[:3, :3]).as_rotvec())
    assert 0.01 * spread < angle < 6 * spread
    assert spread < np.radians(2)
    plane = rng.uniform(-1, 1, (2000, 3)) * [1, 1, 1e-3]
    flat = result_of(submitted(server, npz(plane), npz(plane)))
    assert np.array(flat["free_directions"]).shape == (3, 6)


@pytest.mark.parametrize(
    ("usual", "other"),
    [
        ({}, {"voxel_size": 0.04}),
        ({"method": "mpe"}, {"method": "mpe", "field": "exact"}),
    ],
)
def test_options_that_only_change_the_way(
    server: Server, usual: dict[str, Any], other: dict[str, Any]
) -> None:
    rng = np.random.default_rng(2)
    target, source = knot(2000, rng), knot(2000, rng)
    first, second = (
        np.array(result_of(submitted(server, npz(source), npz(target), options))["transform"])
        for options in (usual, other)
    )
    assert first.tolist() != second.tolist()
    np.testing.assert_allclose(first, second, atol=0.03)


def test_options_come_back_and_equal_ones_are_the_same_work(server: Server) -> None:
    cloud = npz(GOOD)
    turn = np.eye(4, dtype=int).tolist()
    options = {
        "initial_transform": turn,
        "source_gravity": [0, 0, -1],
        "target_gravity": [0, 0, -1],
        "source_viewpoint": [0, 1, 2],
        "target_viewpoint": [0, 1, 2],
        "yaw_only": True,
        "voxel_size": 0.03,
    }
    job = submitted(server, cloud, cloud, options)
    assert job["options"] == job["options"] | options
    assert server.client.get(f"/v1/registrations/{job['id']}").json()["options"] == job["options"]
    below_zero = np.where(np.eye(4) == 0, -0.0, 1.0).tolist()
    equal = {"source_gravity": [0, -0.0, -1.0], "initial_transform": below_zero}
    again = submitted(server, cloud, cloud, options | equal)
    other = submitted(server, cloud, cloud, options | {"source_gravity": [0, 0.1, -1]})
    assert (job["cached"], again["cached"], other["cached"]) == (False, True, False)
    assert again["result"] == job["result"]


@pytest.mark.parametrize(
    ("options", "pointer", "words"),
    [
        ({"initial_transform": np.eye(3).tolist()}, "initial_transform", "4x4 or 3x4 numbers"),
        ({"initial_transform": "here"}, "initial_transform", "4x4 or 3x4 numbers"),
        ({"initial_transform": (2 * np.eye(4)).tolist()}, "initial_transform", "must be rigid"),
        ({"source_gravity": [0, -1], "target_gravity": [0, 0, 1]}, "source_gravity", "3 numbers"),
        ({"source_gravity": [0, 0, "1"]}, "source_gravity/2", "a valid number"),
        ({"source_gravity": [0, 0, 0], "target_gravity": [0, 0, 1]}, "", "must be a direction"),
        ({"source_viewpoint": [0, 0, 1]}, "", "target_viewpoint: give both"),
        ({"source_viewpoint": [[0, 0], [1, 1]]}, "source_viewpoint", "a list of 3 numbers, x, y"),
        ({"source_viewpoint": 257 * [[0, 0, 1]]}, "source_viewpoint", "a list of 1 to 256 of"),
        ({"source_viewpoint": [[0, 0, "1"]]}, "source_viewpoint/0/2", "a valid number"),
        ({"yaw_only": 1}, "yaw_only", "boolean"),
        ({"yaw_only": True, "method": "mpe"}, "", "yaw_only needs method"),
        ({"voxel_size": 0}, "", "voxel_size must be a number above 0"),
    ],
)
def test_what_makes_no_sense_is_told(
    server: Server, options: dict[str, Any], pointer: str, words: str
) -> None:
    response = server.submit(npz(GOOD), npz(GOOD), options=json.dumps(options))
    problem = response.json()
    assert response.status_code == 422
    assert problem["type"] == "urn:mpe:problem:invalid-request"
    (mistake,) = problem["errors"]
    assert mistake["pointer"] == f"/options/{pointer}".rstrip("/")
    assert words in mistake["detail"]


@pytest.mark.parametrize(
    ("options", "weights", "kind", "words"),
    [
        ({"voxel_size": 5}, {}, "invalid-options", "a thousandth and a fifth of the radius"),
        ({}, {"source": "absent"}, "invalid-weights", "'absent'"),
        ({}, {"target": "word"}, "invalid-weights", "attribute 'word' has type <U4"),
        ({}, {"target": "below"}, "invalid-weights", "must be 0 or more"),
        ({}, {"source": "few"}, "invalid-weights", "must be above 0"),
    ],
)
def test_what_only_the_clouds_tell_fails_with_the_reason(
    server: Server, options: dict[str, Any], weights: dict[str, str], kind: str, words: str
) -> None:
    count = len(GOOD)
    file = npz(
        GOOD,
        good=np.ones(count),
        word=np.full(count, "word"),
        below=np.linspace(-1, 1, count),
        few=np.eye(1, count)[0],
    )
    job = submitted(server, file, file, options, weights)
    assert job["status"] == "failed"
    assert job["error"]["type"] == f"urn:mpe:problem:{kind}"
    assert job["error"]["status"] == 422
    assert words in job["error"]["detail"]
    if words == "'absent'":
        assert "this file: 'below', 'few', 'good', 'word'" in job["error"]["detail"]


def doubled(folder: Path) -> dict[str, bytes]:
    """A cloud and its shifted copy in one, with weights that leave one or the other."""
    target = knot(1500, np.random.default_rng(3))
    points = np.vstack([target, target + SHIFT])
    first = np.repeat([1.0, 0.0], len(target))
    columns = {"first": first, "second": 1 - first}
    write_ply(folder / "source.ply", points, columns)
    write_ply(folder / "target.ply", target)
    rows = np.column_stack([points, *columns.values()])
    lines = [",".join(map(repr, row)) for row in rows.tolist()]
    return {
        "ply": (folder / "source.ply").read_bytes(),
        "npz": npz(points, **columns),
        "csv": "\n".join(["x,y,z,first,second", *lines, ""]).encode(),
        "target": npz(target),
    }


@pytest.mark.parametrize(
    "options",
    [{"method": "mpe"}, {"method": "mpe", "field": "exact"}, {"method": "mpl", "search": "sparse"}],
)
def test_the_paper_s_methods_follow_what_weighs(
    server: Server, data: Path, options: dict[str, Any]
) -> None:
    count = 400
    trial = with_passer(bunny(data, "bun_zipper_res4"), count, np.random.default_rng(5))
    still = np.repeat([1.0, 0.001], [len(trial.source) - count, count])
    files = npz(trial.source, still=still), npz(trial.target, still=still)
    weights = {"source": "still", "target": "still"}
    alone = np.array(result_of(submitted(server, *files, options))["transform"])
    found = np.array(result_of(submitted(server, *files, options, weights))["transform"])
    body = trial.source[:-count]
    # the last step of the turn, 0.06 degrees, and the bias of the radial S, 0.1, twice
    assert_pose_close(found, trial.T_target_source, body, degrees=0.3, shift=0.01)
    assert pose_error(alone, trial.T_target_source, body)[0] > 10


@pytest.mark.parametrize("format", ["ply", "npz", "csv"])
def test_the_pose_follows_what_weighs(server: Server, tmp_path: Path, format: str) -> None:
    files = doubled(tmp_path)
    for name, shift in (("first", 0 * SHIFT), ("second", SHIFT)):
        found = result_of(
            submitted(server, files[format], files["target"], weights={"source": name})
        )
        np.testing.assert_allclose(np.array(found["transform"])[:3, 3], -shift, atol=0.004)


def test_weights_of_a_stored_cloud(server: Server, tmp_path: Path) -> None:
    """It is kept decoded, too, without its weights: each registration says its own."""
    files = doubled(tmp_path)
    for cloud, file in (("doubled", "ply"), ("single", "target")):
        server.client.put(f"/v1/clouds/{cloud}", content=files[file]).raise_for_status()
    wanted = {"source": {"cloud": "doubled"}, "target": {"cloud": "single"}}
    found = []
    for reading in ({}, {"source": {"weights": "first"}}, {"source": {"weights": "second"}}):
        response = server.client.post("/v1/registrations", json=wanted | {"reading": reading})
        job = finished(server.client, response.json()["id"])
        found.append(np.array(result_of(job)["transform"])[:3, 3])
        assert job["source"]["reading"] == reading.get("source", {})
    np.testing.assert_allclose(found[1], 0, atol=0.004)
    np.testing.assert_allclose(found[2], -SHIFT, atol=0.004)
    assert found[0].tolist() not in (found[1].tolist(), found[2].tolist())
