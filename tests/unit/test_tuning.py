"""docs/tuning.md names constants that exist, with the values that the code has."""

from __future__ import annotations

import importlib
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.factories.server import PROJECT

PAGE = (PROJECT / "docs" / "tuning.md").read_text()
NUMBER = re.compile(r"(-?\d[\d,_]*(?:\.\d+)?(?:e-?\d+)?)(?: (ms|kB|KiB|MiB|GiB|%))?")
UNITS = {"": 1, "ms": 1e-3, "kB": 1e3, "KiB": 2**10, "MiB": 2**20, "GiB": 2**30, "%": 0.01}


def constants() -> Iterator[tuple[str, str, str]]:
    """Yield package, name and value of each constant; one row may list several of a module."""
    for section in PAGE.split("\n## ")[1:]:
        package, _, text = section.partition("\n")
        for line in text.splitlines():
            cells = [cell.strip() for cell in line.strip("| ").split(" | ")]
            names = re.split(r", | and ", cells[0])
            if all(re.fullmatch(r"`([\w.]+\.)?_?[A-Z][A-Z0-9_]*`", name) for name in names):
                parts = cells[1].split(", ")
                written = parts if len(parts) == len(names) else [cells[1]] * len(names)
                module = names[0].strip("`").rpartition(".")[0]
                for name, value in zip(names, written, strict=True):
                    own = name.strip("`")
                    full = own if "." in own or not module else f"{module}.{own}"
                    yield package.strip(" `"), full, value


def values(package: str, name: str) -> Iterator[object]:
    """Yield what constants of this name, or `module.NAME`, in the package are."""
    *module, constant = name.split(".")
    folder = PROJECT / Path(*package.split("."))
    paths = sorted(folder.rglob("*.py")) if folder.is_dir() else [folder.with_suffix(".py")]
    for path in paths:
        parts = path.relative_to(PROJECT).with_suffix("").parts
        parts = parts[:-1] if parts[-1] == "__init__" else parts
        assigned = re.search(rf"^(.*, )?{constant}\b[^(\n]*=", path.read_text(), re.MULTILINE)
        if assigned and list(parts[len(parts) - len(module) :]) == module:
            yield getattr(importlib.import_module(".".join(parts)), constant)


def numbers(value: object) -> list[float]:
    """Return the numbers in a constant; none where it is no number."""
    try:
        return [float(v) for v in (value if isinstance(value, tuple) else (value,))]  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return []


@pytest.mark.parametrize(("package", "name", "written"), list(constants()))
def test_a_constant_exists_with_the_value_of_the_page(
    package: str, name: str, written: str
) -> None:
    found = [numbers(value) for value in values(package, name)]
    assert found, f"{package} has no constant {name}"
    page = [float(n.replace(",", "")) * UNITS[unit] for n, unit in NUMBER.findall(written)]
    assert any(page[: len(v)] == pytest.approx(v, rel=1e-6) for v in found), (page, found)
