"""`mpe_client` with the real service; the examples of its README as they are printed."""

from __future__ import annotations

import io
import os
import re
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from mpe_client import Client, ProblemError, Progress, RegistrationFailedError, StoredCloud
from service.formats import read_points, write_ply
from tests.factories.scans import arms
from tests.factories.server import PROJECT, Server, running_server
from tests.factories.slow import slow_pair

README = PROJECT / "mpe_client" / "README.md"
EXAMPLES = re.findall(r"^```python\n(.*?)^```", README.read_text(), re.M | re.S)
POINTS = arms(1, 5000)
MOVED = POINTS + np.array([0.5, 0.25, 0.125])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("client")
    write_ply(folder / "source.ply", POINTS)
    write_ply(folder / "target.ply", MOVED)
    return folder


@pytest.fixture
def client(server: Server) -> Iterator[Client]:
    with Client(server.url, resumable_bytes=20_000) as client:
        yield client


def test_there_are_five_examples() -> None:
    assert len(EXAMPLES) == 5


@pytest.mark.parametrize("example", EXAMPLES, ids=range(1, len(EXAMPLES) + 1))
def test_an_example_runs(example: str, folder: Path, server: Server) -> None:
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", example],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(PROJECT), "MPE_CLIENT_URL": server.url},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout


def test_every_kind_of_cloud_gives_the_same_pose(client: Client, folder: Path) -> None:
    stored = client.upload(MOVED)
    cut = io.BytesIO((folder / "source.ply").read_bytes()[:-1])
    poses = []
    content = io.BytesIO((folder / "source.ply").read_bytes())
    for source in (folder / "source.ply", POINTS, content):
        job = client.align(source, StoredCloud(stored.id))
        poses.append(job.require_result().translation)
    np.testing.assert_allclose(poses, np.tile([0.5, 0.25, 0.125], (3, 1)), atol=1e-3)
    with pytest.raises(RegistrationFailedError, match="the file ends after") as caught:
        client.align(cut, stored)
    assert caught.value.job.status == "failed"
    client.delete_cloud(stored.id)


def test_the_moved_source_is_downloaded(client: Client, folder: Path) -> None:
    job = client.align(POINTS, MOVED, labels={"part": "client"})
    deviation = client.deviation(job.id, tolerances=[0.01], max_distance=1.0)
    assert deviation.shares[0].share == 1.0
    assert (deviation.count, deviation.signed) == (len(POINTS), False)
    path = client.download_aligned(job.id, folder / "moved.npy", distances=True)
    assert read_points(path, attributes=True).attributes["distance"].max() < 0.01
    np.testing.assert_allclose(read_points(path).points, MOVED, atol=1e-3)
    assert len(client.inliers(job.id).pairs) == job.require_result().inliers.count
    assert [item.id for item in client.list(label="part:client")] == [job.id]
    assert [item.id for item in client.list(search=f"client {job.id}")] == [job.id]
    with pytest.raises(ProblemError, match="format"):
        client.download_aligned(job.id, folder / "moved.docx")
    assert sorted(path.name for path in folder.glob("moved*")) == ["moved.npy"]
    client.delete(job.id)
    with pytest.raises(ProblemError, match="404"):
        client.get(job.id)


def test_an_interrupt_cancels_the_registration(client: Client) -> None:
    seen: list[str] = []

    def interrupt(progress: Progress) -> None:
        seen.append(progress.stage)
        raise KeyboardInterrupt

    source, target = slow_pair()
    with pytest.raises(KeyboardInterrupt):
        client.align(
            io.BytesIO(source),
            io.BytesIO(target),
            on_progress=interrupt,
            cancel_on_interrupt=True,
            labels={"part": "interrupted"},
            method="mpe",
            field="exact",
            max_iterations=10_000,
        )
    (job,) = client.list(label="part:interrupted")
    assert (job.status, seen) == ("cancelled", ["queued"])


def test_a_wait_survives_a_killed_and_restarted_server(tmp_path: Path) -> None:
    with running_server(tmp_path) as server, Client(server.url) as client:
        restart = threading.Thread(target=server.start)
        stages: list[str] = []

        def kill_at_first(progress: Progress) -> None:
            if not stages:
                server.kill()
                restart.start()
            stages.append(progress.stage)

        job = client.align(arms(1, 20_000), arms(2, 20_000), on_progress=kill_at_first)
        restart.join()
        assert stages[-1] == "finished"
        assert client.get(job.id) == job
        assert len(list(client.list())) == 1
