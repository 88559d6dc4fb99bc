"""/docs: the documents, built from docs/ into files beside this package."""

from __future__ import annotations

from fastapi import APIRouter, Response
from fastapi.responses import RedirectResponse

from service.api.download import DownloadResponse
from service.api.site import SITE_HEADERS, find_document

router = APIRouter(include_in_schema=False)


@router.get("/docs")
def documents() -> Response:
    """Lead to the first page; the place is relative, so it repeats no Host."""
    return RedirectResponse("docs/")


@router.get("/docs/{path:path}")
def document(path: str) -> Response:
    """Return a page of the documents or a file of it."""
    return DownloadResponse(find_document(path), headers=SITE_HEADERS)
