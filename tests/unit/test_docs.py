"""The pages under docs say what the code does."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from service.settings import RENAMED_VARIABLES
from tools.reference_pages import REFERENCE, render_pages

PROJECT = Path(__file__).parent.parent.parent
PAGES = [
    *PROJECT.glob("*.md"),
    *PROJECT.glob("docs/**/*.md"),
    PROJECT / "mpe_client" / "README.md",
]
SETTINGS = set(re.findall(r"`(MPE_\w+)`", render_pages()["settings.md"]))
NOT_SETTINGS = {
    "MPE_DATA", "MPE_REQUIRE_REAL_DATA", "MPE_REQUIRE_POSTGRES", "MPE_KEY_",
    "MPE_CLIENT_URL", "MPE_CLIENT_KEY",
}  # fmt: skip
"""Variables of the tests and of the client, and a prefix that a page names."""

each_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)


@pytest.mark.parametrize("name", render_pages())
def test_reference_pages_are_current(name: str) -> None:
    assert (REFERENCE / name).read_text() == render_pages()[name], "run `make openapi`"


@each_page
def test_every_setting_that_a_page_names_exists(page: Path) -> None:
    known = SETTINGS | NOT_SETTINGS
    if page.name == "CHANGELOG.md":
        known |= RENAMED_VARIABLES.keys()
    assert set(re.findall(r"MPE_\w+", page.read_text())) <= known


@each_page
def test_every_link_leads_to_a_file(page: Path) -> None:
    for link in re.findall(r"\]\((?!http)([^)#\s]+)[^)]*\)", page.read_text()):
        assert (page.parent / link).exists(), link


def test_every_file_that_a_page_names_exists() -> None:
    named = r"`((?:service|mpe_client|mpe_core|tests|tools)/[\w/]+(?:\.\w+|/))`"
    for page in PAGES:
        for name in re.findall(named, page.read_text()):
            assert (PROJECT / name).exists(), f"{page.name} names {name}"
