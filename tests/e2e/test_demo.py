"""`make demo`, run as a person runs it, in a folder of its own."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import httpx
import pytest

PROJECT = Path(__file__).parent.parent.parent


def demo(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "benchmarks.demo", *arguments],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(PROJECT)},
        capture_output=True,
        text=True,
        check=False,
        timeout=200,
    )


@pytest.fixture(scope="module")
def done(
    tmp_path_factory: pytest.TempPathFactory,
) -> tuple[Path, subprocess.CompletedProcess[str]]:
    folder = tmp_path_factory.mktemp("demo")
    return folder, demo(folder)


def test_the_blade_is_aligned(done: tuple[Path, subprocess.CompletedProcess[str]]) -> None:
    folder, process = done
    assert process.returncode == 0, process.stderr
    apart = re.search(r"frames differ by (\d+\.\d+) degrees", process.stdout)
    error = re.search(r"truth: (\d+\.\d+) degrees, (\d+\.\d+) mm", process.stdout)
    assert apart
    assert error
    assert float(apart[1]) > 30  # the start itself is far off
    assert float(error[1]) < 1
    assert float(error[2]) < 1
    assert (folder / "build/demo/before-after.png").stat().st_size > 10_000


def test_the_printed_curl_is_complete_and_the_service_is_gone(
    done: tuple[Path, subprocess.CompletedProcess[str]],
) -> None:
    folder, process = done
    printed = re.search(r"^\$ (curl .*)$", process.stdout, re.M)
    assert printed
    words = shlex.split(printed[1])
    files = [word.partition("@")[2] for word in words if "=@" in word]
    assert len(files) == 2
    assert all((folder / name).is_file() for name in files)
    with pytest.raises(httpx.ConnectError):
        httpx.get(words[-1], trust_env=False)


def test_any_two_files(done: tuple[Path, subprocess.CompletedProcess[str]], tmp_path: Path) -> None:
    folder, _ = done
    source, target = folder / "build/demo/source.ply", folder / "build/demo/target.ply"
    process = demo(tmp_path, "--source", str(source), "--target", str(target))
    assert process.returncode == 0, process.stderr
    assert '"status": "succeeded"' in process.stdout
    assert (tmp_path / "build/demo/before-after.png").exists()


def test_a_bad_file_is_told(tmp_path: Path) -> None:
    process = demo(tmp_path, "--source", __file__, "--target", __file__)
    assert process.returncode == 1
    assert '"title"' in process.stdout
    assert "Traceback" not in process.stderr
