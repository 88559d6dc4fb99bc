"""What the routes ask for, as annotated dependencies."""

from __future__ import annotations

import re
from typing import Annotated

from fastapi import Depends, Header, Request

from service.core import Service
from service.submission import Submission, read_submission

_WAIT = re.compile(r"(?:^|[,;])\s*wait\s*=\s*\"?(\d{1,6})\"?\s*(?=[,;]|$)", re.IGNORECASE)


def _service(request: Request) -> Service:
    service: Service = request.app.state.service
    return service


CurrentService = Annotated[Service, Depends(_service)]


async def _submission(request: Request, service: CurrentService) -> Submission:
    return await read_submission(request, service)


NewSubmission = Annotated[Submission, Depends(_submission)]


def _wait(
    service: CurrentService,
    prefer: Annotated[
        str | None,
        Header(
            description="`wait=N`: answer when the registration has ended, after N seconds at the "
            "latest. The registration goes on either way."
        ),
    ] = None,
) -> float | None:
    asked = _WAIT.search(prefer or "")
    return None if asked is None else min(float(asked.group(1)), service.settings.max_wait_s)


PreferredWait = Annotated[float | None, Depends(_wait)]
