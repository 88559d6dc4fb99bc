"""Resumable uploads by tus 1.0 (tus.io): a broken line costs the piece that it broke."""

from __future__ import annotations

import httpx

from mpe_client.errors import ProblemError, UnreachableError
from mpe_client.inputs import LocalFile
from mpe_client.retry import Tries
from mpe_client.session import Session

PIECE_BYTES = 8 << 20
"""Bytes of a request; a broken connection loses less, as the service keeps what has arrived."""
TUS = {"Tus-Resumable": "1.0.0"}
_CONFLICT = "urn:mpe:problem:upload-conflict"


async def upload_resumably(session: Session, source: LocalFile, format: str | None) -> str:
    """Upload a file in pieces, and return the id of the stored cloud.

    Raises
    ------
    ProblemError
        The service refuses it.
    UnreachableError
        It did not answer within the patience.
    """
    params = {} if format is None else {"format": format}
    length = {"Upload-Length": str(source.size)}
    created = await session.call("POST", "/v1/uploads", headers=TUS | length, params=params)
    place, tries, offset = created.headers["Location"], Tries(session.patience), 0
    while offset < source.size:
        try:
            offset = await _send_piece(session, place, source, offset)
            tries.reset()
        except (httpx.TransportError, ProblemError) as error:
            pause = tries.next_pause() if _is_passing(error) else None
            if pause is None:
                raise _as_client_error(error) from error
            await session.transport.sleep(pause)
            offset = await _ask_offset(session, place)
    return str(place).rsplit("/", 1)[-1]


async def _send_piece(session: Session, place: str, source: LocalFile, offset: int) -> int:
    """Send the piece at the offset; return the offset that the service answers."""
    source.file.seek(source.start + offset)
    piece = source.file.read(min(PIECE_BYTES, source.size - offset))
    headers = TUS | {
        "Upload-Offset": str(offset),
        "Content-Type": "application/offset+octet-stream",
    }
    response = await session.try_once("PATCH", place, headers=headers, content=piece)
    return int(response.headers["Upload-Offset"])


async def _ask_offset(session: Session, place: str) -> int:
    response = await session.call("HEAD", place, headers=TUS)
    return int(response.headers["Upload-Offset"])


def _is_passing(error: Exception) -> bool:
    """Return whether asking for the offset and going on may help."""
    if isinstance(error, ProblemError):
        problem = error.problem
        return problem.type == _CONFLICT or problem.status in (429, 502, 503, 504)
    return True


def _as_client_error(error: Exception) -> Exception:
    if isinstance(error, ProblemError):
        return error
    return UnreachableError(f"the upload broke again and again: {error}")
