"""docs/architecture.md lists the floors that the import contracts hold."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tools.structure import Structure, read_structures

PROJECT = Path(__file__).parent.parent.parent
STRUCTURES = read_structures()
each_root = pytest.mark.parametrize("structure", STRUCTURES, ids=lambda item: item.root)


def listed_floors(root: str) -> list[list[str]]:
    """Names of the packages on each floor of the page's table, the highest floor first."""
    page = (PROJECT / "docs" / "architecture.md").read_text()
    section = page.partition(f"## {root}\n")[2].partition("\n## ")[0]
    floors: dict[int, list[str]] = {}
    for number, name in re.findall(r"^\| (\d+) \| `(\w+)` \|", section, re.M):
        floors.setdefault(int(number), []).append(name)
    assert sorted(floors, reverse=True) == list(floors), "the highest floor comes first"
    return list(floors.values())


@each_root
def test_page_lists_the_floors_of_the_contract(structure: Structure) -> None:
    assert listed_floors(structure.root) == structure.floors


@each_root
def test_every_package_stands_on_one_floor(structure: Structure) -> None:
    names = [name for floor in structure.floors for name in floor]
    assert sorted(names) == sorted(structure.packages)


@each_root
def test_nothing_runs_up(structure: Structure) -> None:
    assert structure.upward == []


@each_root
def test_no_modules_import_each_other(structure: Structure) -> None:
    assert structure.cycles == []


def test_each_package_has_a_contract() -> None:
    assert {item.root for item in STRUCTURES} == {"service", "mpe_core", "mpe_client"}


def test_cycles_and_upward_arrows_are_found() -> None:
    imports = {
        "p": set(),
        "p.low": {"p.high.a"},
        "p.high.a": {"p.high.b"},
        "p.high.b": {"p.high.c", "p.low"},
        "p.high.c": {"p.high.b"},
        "p.other": {"p.low"},
    }
    structure = Structure("p", [["high"], ["other", "low"]], imports)
    assert structure.cycles == [["p.high.a", "p.high.b", "p.high.c", "p.low"]]
    assert structure.upward == [("low", "high"), ("other", "low")]
    imports["p.low"] = set()
    assert Structure("p", [["high"], ["low"]], imports).cycles == [["p.high.b", "p.high.c"]]
