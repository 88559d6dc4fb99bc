"""Files of the page: where they lie, and what the browser lets them do."""

from __future__ import annotations

import re
from pathlib import Path

from service.problems import PageNotFoundError

STATIC = Path(__file__).parent / "static"
"""Folder of what is built: the page, and the site of the documents."""
_PAGE = STATIC / "page"
"""Folder that `make page` writes; the wheel holds it."""
_NAME = re.compile(r"[\w-]+\.[\w.-]*\w", re.ASCII)
PAGE_HEADERS = {
    "Cache-Control": "no-cache",
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
}
"""The page loads its own files and calls its own service, nothing else."""


def find_page() -> Path:
    """Return the HTML file.

    Raises
    ------
    PageNotFoundError
        The page was not built.
    """
    return _require(_PAGE / "index.html")


def find_asset(name: str) -> Path:
    """Return a file of the page by its name.

    Raises
    ------
    PageNotFoundError
        There is no such file.
    """
    if not _NAME.fullmatch(name):
        raise PageNotFoundError("The page has no file of this name; load the page again.")
    return _require(_PAGE / "assets" / name)


def is_file(path: Path) -> bool:
    """Return whether there is such a file; there is none whose name is too long or has a NUL."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def _require(path: Path) -> Path:
    if not is_file(path):
        raise PageNotFoundError(
            "The page or a file of it is missing: load the page again; in a checkout, `make page` "
            "builds it."
        )
    return path
