"""Which licences may ship."""

from __future__ import annotations

import re

import pytest

from tools.check_supply import COPYLEFT, LOCK, licence_problem

PIN = re.compile(r"^[\w.-]+==[^\s;]+", re.M)


@pytest.mark.parametrize(
    ("words", "refused"),
    [
        ("GPL-3.0-or-later", True),
        ("AGPL-3.0-only", True),
        ("License :: OSI Approved :: GNU General Public License v3 (GPLv3)", True),
        ("License :: OSI Approved :: GNU Affero General Public License v3", True),
        ("LGPL-2.1-only", False),
        ("License :: OSI Approved :: GNU Lesser General Public License v3 (LGPLv3)", False),
        ("MIT", False),
        ("BSD-3-Clause AND Zlib", False),
    ],
)
def test_copyleft_is_told_from_the_rest(words: str, refused: bool) -> None:
    assert bool(COPYLEFT.search(words)) == refused


def test_every_shipped_package_may_ship() -> None:
    names = [line.split("==")[0] for line in LOCK.read_text().splitlines() if "==" in line]
    assert "numpy" in names
    assert [text for name in names if (text := licence_problem(name))] == []


def test_what_ships_is_what_is_tested() -> None:
    tested = PIN.findall(LOCK.with_name("requirements-dev.lock").read_text())
    shipped = PIN.findall(LOCK.read_text())
    assert shipped
    assert set(shipped) <= set(tested)
