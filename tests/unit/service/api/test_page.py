"""Files of the page are found by plain names alone; its form knows every option and format."""

from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path

import pytest

from mpe_core import RegistrationOptions
from service.api import page
from service.formats import WRITERS
from service.problems import PageNotFoundError

SOURCES = Path(__file__).parents[4] / "web" / "src"


def test_a_file_is_found_by_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page, "_PAGE", tmp_path)
    with pytest.raises(PageNotFoundError, match="make page"):
        page.find_page()
    (tmp_path / "assets").mkdir()
    for name in ("index.html", "assets/main-AB12.js"):
        (tmp_path / name).write_text(name)
    assert page.find_page().read_text() == "index.html"
    assert page.find_asset("main-AB12.js").read_text() == "assets/main-AB12.js"


NOT_THERE = ["", ".", "..", "../index.html", "a/../b.js", "none.js", "a.js\n", "a" * 300 + ".js"]


@pytest.mark.parametrize("name", NOT_THERE)
def test_no_other_file_is(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page, "_PAGE", tmp_path)
    (tmp_path / "index.html").write_text("page")
    with pytest.raises(PageNotFoundError):
        page.find_asset(name)


def test_the_page_may_load_from_its_own_host_alone() -> None:
    policy = page.PAGE_HEADERS["Content-Security-Policy"]
    assert policy.startswith("default-src 'none'")
    assert not re.search(r"unsafe|http|\*", policy)


def test_every_option_has_a_field() -> None:
    named = re.findall(r'name: "(\w+)"', (SOURCES / "options.ts").read_text())
    assert sorted(named) == sorted(field.name for field in fields(RegistrationOptions))


def test_every_format_that_can_be_written_is_offered() -> None:
    listed = re.search(r"FORMATS = \[(.*?)\]", (SOURCES / "downloads.ts").read_text(), re.S)
    assert listed is not None
    assert re.findall(r'"(\w+)"', listed[1]) == list(WRITERS)
