"""The library half needs numpy, scipy and numba only; other libraries load when they are used."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests.factories.cloud_files import ply
from tests.factories.scanner_files import e57, glb, las, obj, off

PROJECT = Path(__file__).parents[4]
LIBRARY = {"mpe_core", "service", "numpy", "scipy", "numba", "llvmlite"}
"""Packages that `import mpe_core, service.formats` may load, beside the standard library."""

LIST_IMPORTS = """
import sys
before = set(sys.modules)
import mpe_core, service.formats
loaded = {name.partition(".")[0] for name in set(sys.modules) - before}
print(*sorted(loaded - sys.stdlib_module_names))
"""
HIDE = """
import sys
from importlib.abc import MetaPathFinder

class Hide(MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {missing!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Hide())
"""


def run(program: str, *arguments: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", program, *arguments],
        cwd=PROJECT,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_library_loads_numpy_scipy_and_numba_only() -> None:
    loaded = {name for name in run(LIST_IMPORTS).split() if not name.startswith("_")}
    assert loaded >= {"mpe_core", "service", "numpy"}
    assert loaded <= LIBRARY


def test_dependencies_are_those_of_the_library() -> None:
    project = tomllib.loads((PROJECT / "pyproject.toml").read_text())["project"]
    names = {item.partition(">")[0] for item in project["dependencies"]}
    assert names == {"numpy", "scipy", "numba"}
    extra = {
        item.partition(">")[0].partition("[")[0]
        for item in project["optional-dependencies"]["service"]
    }
    assert {"fastapi", "pydantic", "sqlalchemy", "laspy", "pye57", "trimesh"} <= extra


LIBRARIES = {
    "laspy": las(),
    "pye57": e57(),
    "trimesh": glb(),
}


@pytest.mark.parametrize("library", LIBRARIES)
def test_a_missing_library_is_named_with_the_extra(tmp_path: Path, library: str) -> None:
    (tmp_path / "cloud").write_bytes(LIBRARIES[library])
    program = HIDE.format(missing={library}) + (
        "import service.formats as formats\n"
        "try:\n"
        "    formats.read_points(sys.argv[1])\n"
        "except formats.MissingLibraryError as error:\n"
        "    print(error)\n"
    )
    words = run(program, str(tmp_path / "cloud"))
    assert repr(library) in words
    assert "pip install 'mpe[service]'" in words


@pytest.mark.parametrize("content", [ply(), obj(), off()], ids=["ply", "obj", "off"])
def test_other_formats_need_no_library(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "cloud").write_bytes(content)
    program = HIDE.format(missing=set(LIBRARIES)) + (
        "import service.formats as formats\nprint(len(formats.read_points(sys.argv[1]).points))\n"
    )
    assert run(program, str(tmp_path / "cloud")).strip() == "40"
