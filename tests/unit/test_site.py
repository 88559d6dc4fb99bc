"""The site of the documents holds every page, and its links stay within it."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

from tools.build_site import find_pages, move_links, move_scripts, move_style
from tools.diagrams import draw_diagrams

PROJECT = Path(__file__).parent.parent.parent
PLACES = find_pages()
TROUBLES = (PROJECT / "docs" / "troubleshooting.md").read_text()
SOURCES = "\n".join(
    path.read_text()
    for package in ("service", "mpe_core", "mpe_client")
    for path in (PROJECT / package).rglob("*.py")
)


def listed(entries: list[Any]) -> list[str]:
    """Pages of a navigation, however deep."""
    places: list[str] = []
    for entry in entries:
        for value in entry.values():
            places += [value] if isinstance(value, str) else listed(value)
    return places


def test_the_navigation_has_every_page() -> None:
    nav = tomllib.loads((PROJECT / "zensical.toml").read_text())["project"]["nav"]
    told = set(listed(nav))
    assert told <= set(PLACES.values())
    of_folders = ("decisions/", "results/")
    pages = {place for place in PLACES.values() if place.endswith(".md")}
    assert pages - told == {
        place for place in pages if place.startswith(of_folders) and not place.endswith("README.md")
    }


@pytest.mark.parametrize(
    ("origin", "link", "moved"),
    [
        ("CONTRIBUTING.md", "[a](docs/method.md#search)", "[a](method.md#search)"),
        ("docs/reference/api.md", "[a](../../SECURITY.md)", "[a](../security.md)"),
        ("docs/method.md", "[a](../service/app.py)", "a"),
        ("docs/method.md", "[a](https://example.org/x.md)", "[a](https://example.org/x.md)"),
        ("mpe_client/README.md", "![a](../docs/images/page.png)", "![a](images/page.png)"),
    ],
)
def test_links_lead_to_places_in_the_site(origin: str, link: str, moved: str) -> None:
    assert move_links(link, origin, PLACES) == moved


def test_diagrams_become_pictures_without_another_host(tmp_path: Path) -> None:
    if not (PROJECT / "web" / "node_modules").is_dir():
        pytest.skip("the packages of the page are not installed: `make page` does that")
    page = "## Boxes\n\n```mermaid\nflowchart LR\n    A[one] --> B[two]\n```\n\nText.\n"
    drawn = draw_diagrams(page, tmp_path)
    (picture,) = tmp_path.glob("*.svg")
    link = f"[![Diagram: Boxes]({picture.name})]({picture.name})"
    assert drawn == f"## Boxes\n\n{link}\n\nText.\n"
    svg = picture.read_text()
    assert ">one<" in svg
    assert "http" not in svg.replace("http://www.w3.org/2000/svg", "")
    with pytest.raises(SystemExit, match="has failed"):
        draw_diagrams(page.replace("flowchart LR", "gitGraph"), tmp_path)
    assert draw_diagrams("Text.", tmp_path) == "Text."


def test_scripts_become_files_and_the_style_a_sheet(tmp_path: Path) -> None:
    (tmp_path / "assets" / "javascripts").mkdir(parents=True)
    (tmp_path / "deep").mkdir()
    page = tmp_path / "deep" / "page.html"
    page.write_text('<script>one()</script><script id="x" type="application/json">{}</script>')
    move_scripts(tmp_path)
    assert re.fullmatch(
        r'<script src="\.\./assets/inline-\w+\.js"></script><script id="x".*</script>',
        page.read_text(),
    )
    bundle = tmp_path / "assets" / "javascripts" / "bundle.0.min.js"
    bundle.write_text('o.appendChild(C("style",{},Tc.toString()));')
    move_style(tmp_path)
    assert "o.adoptedStyleSheets=[sheet]" in bundle.read_text()
    with pytest.raises(ValueError, match="expected one style"):
        move_style(tmp_path)


@pytest.mark.parametrize("message", re.findall(r"^### `(.+)`$", TROUBLES, re.M))
def test_messages_that_are_explained_are_said(message: str) -> None:
    for part in message.split("%d"):
        assert part.strip() in SOURCES
