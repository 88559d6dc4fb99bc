"""What works where only the dependencies of `mpe_core` are installed."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from importlib.util import find_spec
from pathlib import Path

import pytest

PROJECT = Path(__file__).parent.parent.parent
DEPENDENCIES = {"numpy", "scipy", "numba"}
FOLDERS = ("numpy", "numpy.libs", "scipy", "scipy.libs", "numba", "llvmlite")
"""Of the dependencies and of what they need in turn."""
REGISTER = """
import numpy as np
from mpe_core import register

points = np.random.default_rng(0).normal(size=(300, 3)) * (3, 2, 1)
result = register(points, points + (0.5, 0.0, 0.0))
np.testing.assert_allclose(result.T_target_source[:3, 3], (0.5, 0.0, 0.0), atol=1e-3)
"""
READ = """
import tempfile
from pathlib import Path
from service.formats import read_points

path = Path(tempfile.mkdtemp()) / "cloud.xyz"
path.write_text("1 2 3\\n4 5 6\\n7 8 0\\n")
assert read_points(path).points.shape == (3, 3)
"""


@pytest.fixture
def bare(tmp_path: Path) -> Path:
    """Folder that holds the dependencies and no other package."""
    numpy = find_spec("numpy")
    assert numpy is not None
    assert numpy.origin is not None
    installed = Path(numpy.origin).parent.parent
    for name in FOLDERS:
        if (installed / name).exists():
            (tmp_path / name).symlink_to(installed / name)
    return tmp_path


def run(bare: Path, code: str) -> None:
    """Run the code where nothing is installed but the dependencies."""
    path = f"import sys; sys.path[:0] = [{str(bare)!r}, {str(PROJECT)!r}]\n"
    done = subprocess.run(
        [sys.executable, "-I", "-S", "-c", path + code],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr


def test_declared_dependencies_are_these() -> None:
    project = tomllib.loads((PROJECT / "pyproject.toml").read_text())["project"]
    declared = {re.split(r"[^\w-]", text)[0] for text in project["dependencies"]}
    assert declared == DEPENDENCIES


def test_nothing_else_can_be_imported(bare: Path) -> None:
    run(
        bare,
        "from importlib.util import find_spec\n"
        "for name in ('pydantic', 'fastapi', 'sqlalchemy', 'trimesh'):\n"
        "    assert find_spec(name) is None, name\n",
    )


def test_clouds_are_registered(bare: Path) -> None:
    run(bare, REGISTER)


def test_files_are_read(bare: Path) -> None:
    run(bare, READ)


def test_the_client_loads_httpx_alone() -> None:
    code = (
        "import sys, mpe_client\n"
        "heavy = {'numpy', 'numba', 'scipy', 'fastapi', 'pydantic', 'open3d', 'service',"
        " 'mpe_core'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", code], cwd=PROJECT, check=True, timeout=60)


def test_the_command_names_what_to_install(bare: Path) -> None:
    run(
        bare,
        "import contextlib, io\n"
        "from service.cli import main\n"
        "with contextlib.redirect_stderr(io.StringIO()) as printed:\n"
        "    assert main(['align', 'a.ply', 'b.ply']) == 2\n"
        "assert \"pip install 'mpe[service]'\" in printed.getvalue()\n",
    )
