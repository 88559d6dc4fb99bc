"""What a server logs."""

from __future__ import annotations

import json
from collections import Counter
from typing import Any


def logged_errors(log: str) -> Counter[str]:
    """What the server says went wrong and nobody meant to, with exceptions; kills are warnings."""
    errors = [line for line in _lines(log) if line.get("level") in ("ERROR", "CRITICAL")]
    return Counter(f"{line['message']} {_exception(line)}".strip() for line in errors)


def logged_exceptions(log: str, job: str) -> list[str]:
    """Traces that the server logged of a job."""
    return [
        line["exc_info"] for line in _lines(log) if line.get("job_id") == job and "exc_info" in line
    ]


def _lines(log: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in log.splitlines() if line[:1] + line[-1:] == "{}"]


def _exception(line: dict[str, Any]) -> str:
    """Last line of the trace, which names the exception."""
    return str(line.get("exc_info", "")).strip().rpartition("\n")[2]


def without_requests(log: str) -> str:
    """The lines of a server's log but those that tell of a request."""
    return "\n".join(line for line in log.splitlines() if "api.middleware.request_log" not in line)
