"""The command `mpe` as a person runs it."""

from __future__ import annotations

import json
import os
import re
import resource
import signal
import subprocess
import sys
from pathlib import Path

import httpx
import numpy as np
import pytest
from numpy.typing import NDArray

from service.formats import read_points, write_ply
from tests.factories.server import free_port
from tests.factories.waiting import until

MPE = Path(sys.executable).parent / "mpe"
ANGLE = np.radians(25)
T_TARGET_SOURCE = np.array(
    [
        [np.cos(ANGLE), -np.sin(ANGLE), 0, 0.3],
        [np.sin(ANGLE), np.cos(ANGLE), 0, -0.2],
        [0, 0, 1, 0.1],
        [0, 0, 0, 1],
    ]
)


def mpe(*arguments: object, **variables: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [MPE, *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
        env=os.environ | variables,
    )


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A lopsided shell of 3,000 points, and the same turned and moved."""
    rng = np.random.default_rng(3)
    directions = rng.normal(size=(3000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    bump = 1 + 0.5 * np.exp(8 * (directions @ np.c_[[0.6, 0.8, 0]] - 1)) + 0.3 * directions[:, 2:]
    source: NDArray[np.float64] = directions * bump * [1, 0.7, 0.4]
    folder = tmp_path_factory.mktemp("pair")
    write_ply(folder / "source.ply", source)
    write_ply(folder / "target.ply", source @ T_TARGET_SOURCE[:3, :3].T + T_TARGET_SOURCE[:3, 3])
    return folder / "source.ply", folder / "target.ply"


def test_files_beyond_the_memory_are_thinned(tmp_path: Path) -> None:
    """4 million points need 1.8 GB; the process has 1 GiB."""
    rng = np.random.default_rng(5)
    x, y = rng.uniform(-1, 1, (2, 1_000_000))
    points = np.stack([x, y, 0.3 * np.sin(3 * x + y) + 0.1 * x * y], axis=1)
    write_ply(tmp_path / "source.ply", np.tile(points, (4, 1)).astype(np.float32))
    moved = points[::10] @ T_TARGET_SOURCE[:3, :3].T + T_TARGET_SOURCE[:3, 3]
    write_ply(tmp_path / "target.ply", moved)
    limit = 1 << 30
    done = subprocess.run(
        [MPE, "align", tmp_path / "source.ply", tmp_path / "target.ply", "--json"],
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)),
    )
    assert done.returncode in (0, 3), done.stderr
    assert "of 4000000 points" in done.stderr
    np.testing.assert_allclose(json.loads(done.stdout)["transform"], T_TARGET_SOURCE, atol=5e-3)


def test_align_prints_the_pose_and_writes_the_moved_source(
    pair: tuple[Path, Path], tmp_path: Path
) -> None:
    done = mpe("align", *pair, "--json", "-o", tmp_path / "aligned.ply")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    np.testing.assert_allclose(result["transform"], T_TARGET_SOURCE, atol=1e-3)
    aligned, target = read_points(tmp_path / "aligned.ply"), read_points(pair[1])
    np.testing.assert_allclose(aligned.points, target.points, atol=3e-3)


@pytest.mark.parametrize("ending", ["pcd", "laz", "npy"])
def test_the_ending_says_how_to_write(pair: tuple[Path, Path], tmp_path: Path, ending: str) -> None:
    done = mpe("align", *pair, "-o", tmp_path / f"aligned.{ending}")
    assert done.returncode == 0, done.stderr
    aligned, target = read_points(tmp_path / f"aligned.{ending}"), read_points(pair[1])
    np.testing.assert_allclose(aligned.points, target.points, atol=3e-3)


def test_how_to_read_is_said_for_each_file(pair: tuple[Path, Path], tmp_path: Path) -> None:
    points = read_points(pair[0]).points
    rows = np.column_stack([points, np.ones(len(points))]).astype("<f4")
    (tmp_path / "scan.bin").write_bytes(rows.tobytes())
    refused = mpe("align", tmp_path / "scan.bin", pair[1])
    assert refused.returncode == 1
    done = mpe("align", tmp_path / "scan.bin", pair[1], "--source-format", "kitti")
    assert done.returncode == 0, done.stderr


def test_summary_is_for_people(pair: tuple[Path, Path]) -> None:
    done = mpe("align", *pair)
    assert done.returncode == 0, done.stderr
    assert re.search(r"rotation +25\.\d+ degrees", done.stdout)
    assert re.search(r"overlap +\d+\.\d % of the source", done.stdout)


def test_options_reach_the_registration(pair: tuple[Path, Path]) -> None:
    done = mpe("align", *pair, "--json", "--inlier-threshold", "0.125", "--overlap", "0.5")
    assert json.loads(done.stdout)["inliers"]["threshold"] == 0.125


def test_the_field_is_chosen(pair: tuple[Path, Path]) -> None:
    tree, exact = (
        json.loads(mpe("align", *pair, "--json", "--method", "mpe", "--field", field).stdout)
        for field in ("tree", "exact")
    )
    assert tree["transform"] != exact["transform"]  # another sum of the same forces
    np.testing.assert_allclose(tree["transform"], exact["transform"], atol=1e-3)


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["align", "missing.ply", "missing.ply"], 1, "missing.ply: No such file"),
        (["align", __file__, __file__], 1, "test_cli.py: "),
        (["align", "SOURCE", "TARGET", "--overlap", "2"], 1, "overlap must be"),
        (["align", "SOURCE", "TARGET", "-o", "no/such/folder/a.ply"], 1, "no/such/folder/a.ply"),
        (
            ["align", "SOURCE", "TARGET", "-o", "a.docx"],
            1,
            "a.docx: expected a file name that ends in ply",
        ),
        (
            ["align", "SOURCE", "TARGET", "--source-scan", "1"],
            1,
            "scan is set, but the file is of format ply",
        ),
        (["align", "SOURCE"], 2, "usage"),
        (["align", "SOURCE", "TARGET", "--method", "magic"], 2, "invalid choice"),
        (["align", "SOURCE", "TARGET", "--sample-size", "many"], 2, "invalid int"),
        (["destroy"], 2, "invalid choice"),
    ],
)
def test_mistakes_are_told_without_a_traceback(
    pair: tuple[Path, Path], arguments: list[str], code: int, words: str
) -> None:
    places = {"SOURCE": str(pair[0]), "TARGET": str(pair[1])}
    done = mpe(*[places.get(word, word) for word in arguments])
    assert done.returncode == code
    assert words in done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout == ""


def test_wrong_settings_stop_the_service_from_starting(tmp_path: Path) -> None:
    done = mpe("serve", MPE_DATA_DIR=str(tmp_path), MPE_QUEUE_LIMIT="none")
    assert done.returncode == 2
    assert "MPE_QUEUE_LIMIT" in done.stderr
    assert "Traceback" not in done.stderr


def _is_ready(port: int) -> bool:
    try:
        return httpx.get(f"http://127.0.0.1:{port}/readyz", trust_env=False).status_code == 200
    except httpx.TransportError:
        return False


def test_serve_answers_and_stops(tmp_path: Path) -> None:
    port = free_port()
    environment = os.environ | {"MPE_DATA_DIR": str(tmp_path / "data")}
    with subprocess.Popen(
        [MPE, "serve", "--port", str(port)], env=environment, stderr=subprocess.DEVNULL
    ) as server:
        try:
            until(lambda: _is_ready(port))
            assert (tmp_path / "data").is_dir()
        finally:
            server.send_signal(signal.SIGTERM)
        assert server.wait(timeout=120) in (0, -signal.SIGTERM)


def test_doctor_says_whether_workers_start() -> None:
    done = mpe("doctor")
    assert "workers     start" in done.stdout
    for name in ("libraries", "cores", "memory", "disk", "clock", "kernels", "settings"):
        assert f"\n{name}" in f"\n{done.stdout}"
    assert done.returncode == (1 if "  missing" in done.stdout else 0), done.stderr
