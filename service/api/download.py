"""Files as responses, with ranges that are answered as RFC 9110 says."""

from __future__ import annotations

from starlette.exceptions import HTTPException
from starlette.responses import FileResponse, MalformedRangeHeader, RangeNotSatisfiable


class DownloadResponse(FileResponse):
    """A file: a Range that is not valid is ignored, one beyond its end is a problem document."""

    @classmethod
    def _parse_range_header(cls, http_range: str, file_size: int) -> list[tuple[int, int]]:
        try:
            return super()._parse_range_header(http_range, file_size)
        except MalformedRangeHeader:
            return []
        except RangeNotSatisfiable:
            headers = {"Content-Range": f"bytes */{file_size}"}
            raise HTTPException(416, headers=headers) from None
