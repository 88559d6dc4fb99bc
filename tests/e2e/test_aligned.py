"""The aligned source as a file: moved by the transform, its attributes kept."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import httpx
import laspy
import numpy as np
import pytest
from numpy.typing import NDArray

from mpe_core.geometry.rigid import pose
from service.clouds.transform import transform_cloud
from service.formats import WRITERS, DecodedCloud, read_points, write_cloud
from service.formats.column_names import find_normals
from tests.factories.cloud_files import NORMALS, POINTS, pcd, ply
from tests.factories.meshes import bracket
from tests.factories.scanner_files import DOUBLES, las
from tests.factories.server import Server, running_server
from tests.factories.waiting import until

C, S = np.cos(np.radians(20)), np.sin(np.radians(20))
TURN = np.array([[C, -S, 0], [S, C, 0], [0, 0, 1.0]])


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """Its upkeep looks all the time for files that nobody needs."""
    with running_server(tmp_path_factory.mktemp("server"), maintenance_interval_s=0.05) as running:
        yield running


def target() -> bytes:
    """The same cloud, turned by 20 degrees about z."""
    rows = (DOUBLES @ TURN.T).tolist()
    return "".join(f"{x!r} {y!r} {z!r}\n" for x, y, z in rows).encode()


def registered(server: Server, source: bytes, goal: bytes) -> tuple[str, NDArray[np.float64]]:
    answer = server.submit(source, goal, wait=60, options=json.dumps({"overlap": 1.0}))
    assert answer.status_code == 200, answer.text
    return answer.json()["id"], np.array(answer.json()["result"]["transform"])


def fetched(server: Server, job: str, folder: Path, query: str) -> DecodedCloud:
    answer: httpx.Response = server.client.get(f"/v1/registrations/{job}/aligned?{query}")
    assert answer.status_code == 200, answer.text
    path = folder / "aligned"
    path.write_bytes(answer.content)
    return read_points(path, attributes=True)


@pytest.mark.parametrize("format", [item for item in WRITERS if item != "stl"])
def test_the_source_is_moved_and_keeps_its_attributes(
    server: Server, tmp_path: Path, format: str
) -> None:
    job, T = registered(server, ply(), target())
    cloud = fetched(server, job, tmp_path, f"format={format}")
    expected = POINTS @ T[:3, :3].T + T[:3, 3]
    np.testing.assert_allclose(cloud.points, expected, atol=1e-4)
    assert np.abs(cloud.points - POINTS).max() > 1  # it did move
    if format in ("obj", "glb"):  # no attributes of one number; normals are not read
        return
    names = list(cloud.attributes)
    places = find_normals(names)
    assert places is not None
    kept = np.stack([cloud.attributes[names[i]] for i in places], axis=1)
    np.testing.assert_allclose(kept, NORMALS @ T[:3, :3].T, atol=1e-5)
    np.testing.assert_array_equal(cloud.attributes["red"], np.arange(40))


def test_attributes_of_las_and_pcd(server: Server, tmp_path: Path) -> None:
    far = DOUBLES + np.array([500_000.0, 4_000_000, 0])
    job, T = registered(server, las(), target())
    for format in ("laz", "ply"):
        cloud = fetched(server, job, tmp_path, f"format={format}")
        np.testing.assert_allclose(cloud.points, far @ T[:3, :3].T + T[:3, 3], atol=1e-3)
        np.testing.assert_array_equal(cloud.attributes["intensity"], np.arange(40))
    job, _ = registered(server, pcd(), target())
    cloud = fetched(server, job, tmp_path, "format=pcd")
    names = {f"normal_{axis}" for axis in "xyz"} | {f"histogram_{i}" for i in range(3)}
    assert set(cloud.attributes) == names


def test_what_is_lost_is_named(server: Server) -> None:
    job, _ = registered(server, ply(), target())
    answer = server.client.get(f"/v1/registrations/{job}/aligned?format=obj")
    assert any("'red'" in text for text in json.loads(answer.headers["X-Warnings"]))
    refused = server.client.get(f"/v1/registrations/{job}/aligned?format=stl")
    assert refused.status_code in (415, 422)
    assert "write PLY" in refused.json()["detail"]


def test_of_a_mesh_samples_are_registered_and_vertices_moved(
    server: Server, tmp_path: Path
) -> None:
    mesh = bracket(300)
    write_cloud(tmp_path / "mesh.obj", "obj", mesh)
    write_cloud(tmp_path / "goal.glb", "glb", transform_cloud(mesh, pose(TURN, np.zeros(3))))
    content, goal = ((tmp_path / name).read_bytes() for name in ("mesh.obj", "goal.glb"))
    reading = {"source": {"surface_samples": 9000}}
    answer = server.submit(content, goal, wait=60, reading=json.dumps(reading))
    assert answer.status_code == 200, answer.text
    result, job = answer.json()["result"], answer.json()["id"]
    told = [each["message"] for each in result["warnings"] if each["code"] == "file"]
    assert [text.split(" points")[0] for text in told] == ["source: 9000", "target: 50000"]
    assert result["accepted"]
    rows = np.array(result["inliers"]["pairs"])
    assert rows.max(axis=0) == pytest.approx([9000, 50000], rel=0.01)
    cloud = fetched(server, job, tmp_path, "format=ply")
    np.testing.assert_array_equal(cloud.faces, mesh.faces)
    np.testing.assert_allclose(cloud.points, mesh.points @ TURN.T, atol=0.5)
    stl = server.client.get(f"/v1/registrations/{job}/aligned?format=stl").content
    assert len(stl) == 84 + 50 * len(cloud.faces)


def test_merged_with_the_target(server: Server, tmp_path: Path) -> None:
    job, _ = registered(server, ply(), target())
    cloud = fetched(server, job, tmp_path, "format=ply&merged=true")
    assert cloud.points.shape == (80, 3)
    np.testing.assert_array_equal(cloud.attributes["cloud"], np.repeat([0, 1], 40))
    np.testing.assert_allclose(cloud.points[40:], DOUBLES @ TURN.T, atol=1e-4)


def test_laz_is_read_by_laspy_and_nothing_is_left(server: Server, tmp_path: Path) -> None:
    job, _ = registered(server, ply(), target())
    content = server.client.get(f"/v1/registrations/{job}/aligned?format=laz").content
    (tmp_path / "a.laz").write_bytes(content)
    assert laspy.read(tmp_path / "a.laz").header.point_count == 40
    left = [server.data_dir / name for name in ("scratch", "incoming")]
    until(lambda: not [path for folder in left for path in folder.iterdir()])


def test_what_cannot_be_fetched(server: Server) -> None:
    assert server.client.get("/v1/registrations/none/aligned").status_code == 404
    failed = server.submit(b"0 0 0\n1 1 1\n", target(), wait=60).json()["job"]
    assert server.client.get(f"/v1/registrations/{failed}/aligned").status_code == 409
    job, _ = registered(server, ply(), target())
    assert server.client.get(f"/v1/registrations/{job}/aligned?format=doc").status_code == 422


def test_a_known_file_is_not_sent_again(server: Server) -> None:
    job, _ = registered(server, ply(), target())
    url = f"/v1/registrations/{job}/aligned"
    tag = server.client.get(url).headers["ETag"]
    again = server.client.get(url, headers={"If-None-Match": tag})
    assert (again.status_code, again.content, again.headers["ETag"]) == (304, b"", tag)
    other = server.client.get(f"{url}?format=npy", headers={"If-None-Match": tag})
    assert other.status_code == 200
