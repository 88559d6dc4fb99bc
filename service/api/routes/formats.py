"""/v1/formats: the file formats that the service reads."""

from __future__ import annotations

from fastapi import APIRouter, Depends

from service.api.dependencies import identify
from service.formats import FORMATS
from service.schemas import FormatInfo, FormatList

router = APIRouter(prefix="/v1/formats", tags=["formats"], dependencies=[Depends(identify)])


@router.get("", operation_id="listFormats", summary="List the formats that are read")
def list_formats() -> FormatList:
    """Return all formats; the content of a file decides unless `reading` declares the format."""
    return FormatList(
        items=[
            FormatInfo(
                name=item.name,
                title=item.title,
                extensions=list(item.extensions),
                declared=item.sniff is None,
                choices=[
                    "surface_samples" if name == "faces" else name
                    for name in item.choices
                    if name != "attributes"
                ],
            )
            for item in FORMATS
        ]
    )
