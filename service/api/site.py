"""Files of the documents: where they lie, and what the browser lets them do."""

from __future__ import annotations

from pathlib import Path

from service.api.page import STATIC
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
    site = SITE.resolve()
    file = (site / (path or "index.html")).resolve()
    if not file.is_relative_to(site) or not file.is_file():
        raise PageNotFoundError(
            "The documents have no such page: /docs/ is the first one; in a checkout, `make site` "
            "builds them."
        )
    return file
