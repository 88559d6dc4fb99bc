"""Build the site of the documents, which the service serves under /docs.

python -m tools.build_site    docs/ and the pages outside of it, to service/api/static/docs
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

from tools.diagrams import draw_diagrams
from tools.node import install_packages

PROJECT = Path(__file__).parent.parent
STAGE = PROJECT / "build" / "site"
OUTPUT = PROJECT / "service" / "api" / "static" / "docs"
OUTSIDE = {
    "CONTRIBUTING.md": "contributing.md",
    "SECURITY.md": "security.md",
    "CHANGELOG.md": "changelog.md",
    "mpe_client/README.md": "client.md",
}
"""Pages that lie elsewhere in the project, and their names in the site."""
SUFFIXES = (".md", ".png", ".svg")
_LINK = re.compile(r"\[([^\]]*)\]\((?!https?:|#|mailto:)([^)#\s]+)(#[^)\s]*)?\)")
_SCRIPT = re.compile(r"<script>(.*?)</script>", re.S)
_STYLE = re.compile(r'(\w+)\.appendChild\(\w+\("style",\{\},(\w+)\.toString\(\)\)\)')
"""Where the theme's script puts the style of the search into the page."""
_SHEET = (
    r"(()=>{const sheet=new CSSStyleSheet();sheet.replaceSync(\2.toString());"
    r"\1.adoptedStyleSheets=[sheet]})()"
)


def main() -> int:
    """Stage the pages, build them with warnings as errors, and put the result in its place."""
    install_packages()
    shutil.rmtree(STAGE, ignore_errors=True)
    places = find_pages()
    for origin, place in places.items():
        path = STAGE / "docs" / place
        path.parent.mkdir(parents=True, exist_ok=True)
        if origin.endswith(".md"):
            text = move_links((PROJECT / origin).read_text(), origin, places)
            path.write_text(draw_diagrams(text, path.parent))
        else:
            shutil.copyfile(PROJECT / origin, path)
    shutil.copyfile(PROJECT / "zensical.toml", STAGE / "zensical.toml")
    command = [sys.executable, "-m", "zensical", "build", "--strict"]
    done = subprocess.run(command, cwd=STAGE, capture_output=True, text=True, check=False)
    if done.returncode:
        print(done.stdout + done.stderr, file=sys.stderr)
        return 1
    move_scripts(STAGE / "html")
    move_style(STAGE / "html")
    shutil.rmtree(OUTPUT, ignore_errors=True)
    shutil.copytree(STAGE / "html", OUTPUT)
    return 0


def find_pages() -> dict[str, str]:
    """Return the place in the site of each page and picture, by its path in the project."""
    docs = PROJECT / "docs"
    inside = sorted(path for path in docs.rglob("*") if path.suffix in SUFFIXES)
    return OUTSIDE | {
        path.relative_to(PROJECT).as_posix(): path.relative_to(docs).as_posix() for path in inside
    }


def move_links(text: str, origin: str, places: dict[str, str]) -> str:
    """Point the links of a page to places in the site; of a file outside only the text stays."""
    here = Path(places[origin]).parent

    def move(link: re.Match[str]) -> str:
        words, path, anchor = link[1], link[2], link[3] or ""
        file = os.path.normpath(Path(origin).parent / path)
        if file not in places:
            return words
        return f"[{words}]({os.path.relpath(places[file], here)}{anchor})"

    return _LINK.sub(move, text)


def move_scripts(site: Path) -> None:
    """Move inline scripts to files, so that a policy without `unsafe-inline` lets them run."""
    for page in site.rglob("*.html"):
        to_root = os.path.relpath(site, page.parent)

        def move(script: re.Match[str], to_root: str = to_root) -> str:
            name = f"assets/inline-{hashlib.sha256(script[1].encode()).hexdigest()[:12]}.js"
            (site / name).write_text(script[1])
            return f'<script src="{to_root}/{name}"></script>'

        page.write_text(_SCRIPT.sub(move, page.read_text()))


def move_style(site: Path) -> None:
    """Make the style of the search a sheet, which the policy lets a script do.

    Raises
    ------
    ValueError
        The theme's script has changed.
    """
    (bundle,) = site.glob("assets/javascripts/bundle.*.js")
    text, count = _STYLE.subn(_SHEET, bundle.read_text())
    if count != 1:
        raise ValueError(f"{bundle.name}: expected one style of the search, found {count}")
    bundle.write_text(text)


if __name__ == "__main__":
    sys.exit(main())
