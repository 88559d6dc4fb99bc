"""What a server logs."""

from __future__ import annotations

import json
from collections import Counter


def logged_errors(log: str) -> Counter[str]:
    """What the server says went wrong and nobody meant to; kills are warnings."""
    lines = [json.loads(line) for line in log.splitlines() if line[:1] + line[-1:] == "{}"]
    return Counter(line["message"] for line in lines if line["level"] in ("ERROR", "CRITICAL"))


def without_requests(log: str) -> str:
    """The lines of a server's log but those that tell of a request."""
    return "\n".join(line for line in log.splitlines() if "api.middleware.request_log" not in line)
