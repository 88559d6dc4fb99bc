"""The commands that call a service."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest

from service.formats import read_points, write_ply
from tests.factories.commands import mpe
from tests.factories.scans import arms
from tests.factories.server import Server, free_port

POINTS = arms(1, 4000)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("remote")
    write_ply(folder / "source.ply", POINTS)
    write_ply(folder / "target.ply", POINTS + np.array([0.5, 0.0, 0.0]))
    (folder / "bad.ply").write_bytes((folder / "source.ply").read_bytes()[:-1])
    return folder


def call(server: Server, folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return mpe(folder, *words, client_url=server.url)


def test_the_way_of_a_registration(server: Server, folder: Path) -> None:
    pair = str(folder / "source.ply"), str(folder / "target.ply")
    submitted = call(server, folder, "submit", *pair, "--label", "part=door", "--seed", "5")
    assert submitted.returncode == 0, submitted.stderr
    job_id = submitted.stdout.strip()
    watched = call(server, folder, "watch", job_id, "--json")
    job = json.loads(watched.stdout)
    assert watched.returncode == (0 if job["result"]["accepted"] else 3)
    assert (job["status"], job["labels"], job["options"]["seed"]) == (
        "succeeded",
        {"part": "door"},
        5,
    )
    assert "mpe: finished (100%)" in watched.stderr
    listed = call(server, folder, "list", "--label", "part:door")
    assert job_id in listed.stdout
    assert job_id in call(server, folder, "list", "--search", f"Door {job_id[:8]}").stdout
    assert job_id not in call(server, folder, "list", "--search", "roof").stdout
    for name in ("moved.csv", "report.html", "preview.png"):
        path = folder / name
        done = call(server, folder, "download", job_id, str(path), "--distances", "--unit", "mm")
        assert done.returncode == 0, done.stderr
        assert str(path.stat().st_size) in done.stdout
    moved = read_points(folder / "moved.csv", attributes=True)
    np.testing.assert_allclose(moved.points, POINTS + np.array([0.5, 0, 0]), atol=1e-3)
    assert "distance" in moved.attributes
    assert call(server, folder, "cancel", job_id).stdout.split()[1] == "succeeded"


def test_exit_codes(server: Server, folder: Path) -> None:
    bad = str(folder / "bad.ply"), str(folder / "target.ply")
    failed = call(server, folder, "submit", *bad, "--wait")
    assert (failed.returncode, "the file ends after" in failed.stdout) == (1, True), failed.stderr
    missing = call(server, folder, "submit", "none.ply", bad[1])
    assert (missing.returncode, "none.ply" in missing.stderr) == (1, True)
    assert call(server, folder, "status", "none").returncode == 1
    nobody = f"http://127.0.0.1:{free_port()}"
    dead = mpe(folder, "list", "--url", nobody, "--patience", "0.1")
    assert (dead.returncode, nobody in dead.stderr) == (4, True)
    assert call(server, folder, "list", "--status", "wrong").returncode == 2
