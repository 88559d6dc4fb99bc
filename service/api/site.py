"""Files of the documents: where they lie, and what the browser lets them do."""

from __future__ import annotations

from pathlib import Path

from service.api.page import STATIC, is_file
from service.problems import PageNotFoundError

SITE = STATIC / "docs"
"""Folder that `make site` writes; the wheel holds it."""
SITE_HEADERS = {
    "Cache-Control": "no-cache",
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
        "connect-src 'self'; worker-src 'self'; base-uri 'none'; form-action 'none'; "
        "frame-ancestors 'none'"
    ),
}
"""The documents load their own files alone."""


def find_document(path: str) -> Path:
    """Return a file of the site by its path; of the empty path the first page.

    Raises
    ------
    PageNotFoundError
        There is no such file.
    """
    site, named = SITE.resolve(), SITE / (path or "index.html")
    if not is_file(named) or not (file := named.resolve()).is_relative_to(site):
        raise PageNotFoundError(
            "The documents have no such page: /docs/ is the first one; in a checkout, `make site` "
            "builds them."
        )
    return file
