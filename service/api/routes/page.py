"""/ and /assets: the page, built from web/ into files beside this package."""

from __future__ import annotations

from fastapi import APIRouter, Response

from service.api.download import DownloadResponse
from service.api.page import PAGE_HEADERS, find_asset, find_page

router = APIRouter(include_in_schema=False)


@router.get("/")
def page() -> Response:
    """Return the page; browsers ask each time whether it is still current."""
    return DownloadResponse(find_page(), headers=PAGE_HEADERS)


@router.get("/assets/{name}")
def asset(name: str) -> Response:
    """Return a script, style sheet or picture; its name holds the hash of its content."""
    return DownloadResponse(
        find_asset(name), headers={"Cache-Control": "public, max-age=31536000, immutable"}
    )
