"""The corpus of hostile files, posted to the running service: a reason for each, nothing broken."""

from __future__ import annotations

from collections import Counter
from concurrent.futures import ThreadPoolExecutor

import httpx
import pytest

from tests.factories.cloud_files import seeds
from tests.factories.hostile_files import HUGE, LIES, damaged
from tests.factories.server import Server

TWO_POINTS = b"0 0 0\n1 1 1\n"  # no target to register to: what decodes fails there, in no time
CLIENTS = 8
EVERY = 11
"""One of so many damaged files is posted; unit tests read every one of them."""


def chosen() -> list[tuple[str, bytes]]:
    """Each eleventh of the files that chance has damaged, and all that were made by hand."""
    return [*list(damaged())[::EVERY], *(LIES | HUGE).items()]


@pytest.mark.slow
def test_every_hostile_file_is_answered_with_a_reason(server: Server) -> None:
    def post(case: tuple[str, bytes]) -> tuple[str, httpx.Response]:
        name, content = case
        files = {"source": (f"{name} é\u202e../../x.ply", content), "target": ("t", TWO_POINTS)}
        headers = {"Prefer": "wait=60"}
        return name, server.client.post("/v1/registrations", files=files, headers=headers)

    reasons: Counter[str] = Counter()
    with ThreadPoolExecutor(CLIENTS) as clients:
        for name, answer in clients.map(post, chosen()):
            problem = answer.json()
            assert answer.status_code in (400, 413, 415, 422), (name, problem.get("error"), problem)
            assert answer.headers["content-type"].startswith("application/problem+json"), name
            assert any(word in problem["detail"] for word in ("source", "target")), (name, problem)
            reasons[problem["type"]] += 1
    assert reasons.total() >= 250
    assert len(reasons) >= 3, reasons  # each kind of damage has its own type
    assert server.client.get("/readyz").status_code == 200
    good = seeds()["xyz"]
    after = server.submit(good, good, wait=60)
    assert after.status_code == 200, after.text
