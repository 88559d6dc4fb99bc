"""Every example of README.md, docs/service.md and docs/curl.md is run as it is printed."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from benchmarks.blade import scan
from service.formats import read_points, write_ply
from tests.factories.server import Server, running_server

PROJECT = Path(__file__).parent.parent.parent
README = (PROJECT / "README.md").read_text()
SERVICE = (PROJECT / "docs" / "service.md").read_text()
CURL = (PROJECT / "docs" / "curl.md").read_text()
MAX_WORDS = 1000
MARK = "---- end of block ----"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """Of this file alone: examples make keys, without which it answers nobody then."""
    with running_server(tmp_path_factory.mktemp("server")) as running:
        yield running


def blocks(page: str, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", page, re.M | re.S)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where a person would stand after `make demo`."""
    folder = tmp_path_factory.mktemp("readme")
    (folder / "build/demo").mkdir(parents=True)
    (folder / "README.md").write_text(README)
    for seed, (name, azimuth) in enumerate((("source", -60), ("target", -110))):
        points, _ = scan(*np.radians((azimuth, 17, 0)), seed=seed)
        write_ply(folder / f"build/demo/{name}.ply", points.astype(np.float32))
    return folder


@pytest.fixture(scope="module")
def outputs(folder: Path, server: Server) -> list[str]:
    """What each sh block prints; curl is told where port 8000 really is."""
    (folder / ".curlrc").write_text(f'connect-to = "127.0.0.1:8000:127.0.0.1:{server.port}"\n')
    # those of service.md last: they make a key, and the server then answers nobody without one
    examples = [example for page in (README, CURL, SERVICE) for example in blocks(page, "sh")]
    script = f"\necho '{MARK}'\n".join(examples)
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", script],
        cwd=folder,
        env=os.environ
        | {"PATH": path, "CURL_HOME": str(folder), "MPE_DATA_DIR": str(server.data_dir)},
        capture_output=True,
        text=True,
        check=False,
        timeout=200,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split(MARK)


def test_curl_examples(outputs: list[str], folder: Path) -> None:
    waited, options, lists, removed, refused, align, *_, known, keys = outputs
    first, second = json.loads(waited), json.loads(options)
    assert first["status"] == second["status"] == "succeeded"
    assert second["options"]["overlap"] == 0.8
    pairs = np.load(folder / "build/demo/inliers.npy", allow_pickle=False)
    assert len(pairs) == second["result"]["inliers"]["count"]
    as_json = json.loads((folder / "build/demo/inliers.json").read_text())
    assert as_json["count"] == len(pairs)
    merged = read_points(folder / "build/demo/merged.pcd")
    sizes = [len(read_points(folder / f"build/demo/{n}.ply").points) for n in ("source", "target")]
    assert len(merged.points) == sum(sizes)
    assert second["id"] in [item["id"] for item in json.loads(lists)["items"]]
    assert removed.strip() == ""
    problem = json.loads(refused)
    assert 400 <= problem["status"] < 500
    assert problem["detail"]
    told = json.loads(known)
    assert told["options"]["source_viewpoint"] == [0, 0, 0]
    # on a busy machine the wait of the example may end first
    assert told["status"] in ("queued", "running") or told["result"]["accepted"]
    page, end = json.JSONDecoder().raw_decode(keys.strip())
    assert page["items"] == [], "the tenant sees what others have sent"
    assert ["lab", "laptop"] in [line.split()[1:3] for line in keys.strip()[end:].splitlines()]
    assert "T_target_source" in align
    assert (folder / "build/demo/aligned.ply").exists()


def test_curl_cookbook(outputs: list[str], folder: Path) -> None:
    told = outputs[len(blocks(README, "sh")) : -len(blocks(SERVICE, "sh"))]
    events, pose, _, stored, again, listed = told
    first = json.loads((folder / "build/demo/registration.json").read_text())
    assert json.loads(pose) == first["result"]["transform"]
    assert "event: " in events
    shares = json.loads((folder / "build/demo/deviation.json").read_text())["shares"]
    assert [each["tolerance"] for each in shares] == [1, 2]
    assert read_points(folder / "build/demo/distances.ply").points.shape[1] == 3
    assert " mm" in (folder / "build/demo/report.html").read_text()
    assert (folder / "build/demo/preview.png").read_bytes().startswith(b"\x89PNG")
    cloud, end = json.JSONDecoder().raw_decode(stored.strip())
    assert cloud["id"] == "blade"
    assert json.loads(stored.strip()[end:])["source"]["sha256"] == first["source"]["sha256"]
    assert json.loads(again)["id"]
    found, end = json.JSONDecoder().raw_decode(listed := listed.strip())
    assert first["id"] in [item["id"] for item in found["items"]]
    searched, _ = json.JSONDecoder().raw_decode(listed[end:].strip())
    assert first["id"] in [item["id"] for item in searched["items"]]


def test_library_example(folder: Path) -> None:
    (example,) = blocks(README, "python")
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", example],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(PROJECT)},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert "[[" in done.stdout


def test_aligned_file_is_the_moved_source(outputs: list[str], folder: Path) -> None:
    (align,) = [output for output in outputs if "T_target_source" in output]
    result = json.loads(align[align.index('{"transform"') :])
    T = np.array(result["transform"])
    source = read_points(folder / "build/demo/source.ply").points
    aligned = read_points(folder / "build/demo/aligned.ply").points
    np.testing.assert_allclose(aligned, source @ T[:3, :3].T + T[:3, 3], atol=1e-3)


def test_readme_is_short() -> None:
    assert len(README.split()) <= MAX_WORDS


def test_make_targets_and_files_exist() -> None:
    makefile = (PROJECT / "Makefile").read_text()
    for target in set(re.findall(r"(?:^|`)make ([a-z]+)", README, re.M)):
        assert re.search(rf"^{target}:", makefile, re.M), target
    for link in re.findall(r"\]\((?!http)([^)#]+)\)", README):
        assert (PROJECT / link).exists(), link
