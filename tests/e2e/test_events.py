"""The event stream of a registration."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import httpx

from tests.factories.scans import arms, as_npy
from tests.factories.server import Server, finished
from tests.factories.slow import SLOW, slow_pair

CLOUD = as_npy(arms(2, 5000))
STAGES = ["queued", "decode", "prepare", "search", "refine", "inliers", "finished"]


def follow(client: httpx.Client, job_id: str, last: int | None = None) -> Iterator[dict[str, Any]]:
    """Events as (number and data), until the stream ends."""
    headers = {} if last is None else {"Last-Event-ID": str(last)}
    with client.stream("GET", f"/v1/registrations/{job_id}/events", headers=headers) as response:
        assert response.headers["Content-Type"].startswith("text/event-stream")
        event: dict[str, Any] = {}
        for line in response.iter_lines():
            name, _, value = line.partition(": ")
            if name == "id":
                event["number"] = int(value)
            elif name == "data":
                event |= json.loads(value)
            elif line == "" and event:
                yield event
                event = {}


def test_every_stage_is_told_in_order(server: Server) -> None:
    other = as_npy(arms(3, 5000))  # the same points would need no search
    job = server.submit(CLOUD, other, options='{"seed": 21}').json()
    events = list(follow(server.client, job["id"]))
    assert [event["number"] for event in events] == list(range(1, len(events) + 1))
    assert events[0]["status"] == "queued"
    assert events[-1]["status"] == "succeeded"
    seen = list(dict.fromkeys(event["stage"] for event in events))
    assert seen == STAGES
    fractions = [event["fraction"] for event in events]
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1


def test_a_stream_resumes_after_the_last_event(server: Server) -> None:
    job = server.submit(CLOUD, CLOUD, options='{"seed": 22}', wait=60).json()
    events = list(follow(server.client, job["id"]))
    assert list(follow(server.client, job["id"], last=3)) == events[3:]
    assert list(follow(server.client, job["id"], last=len(events))) == []
    assert list(follow(server.client, job["id"], last=2**53 - 1)) == []


def test_a_number_that_no_event_has(server: Server) -> None:
    job = server.submit(CLOUD, CLOUD).json()
    for number in ("-1", "9223372036854775808", "9" * 5000, "last"):
        headers = {"Last-Event-ID": number}
        answer = server.client.get(f"/v1/registrations/{job['id']}/events", headers=headers)
        assert answer.status_code == 422, number
        assert answer.json()["type"] == "urn:mpe:problem:invalid-request"


def test_a_stream_tells_of_a_cancel(server: Server) -> None:
    job = server.submit(*slow_pair(), options=SLOW).json()
    stream = follow(server.client, job["id"])
    assert next(stream)["status"] == "queued"
    server.client.delete(f"/v1/registrations/{job['id']}")
    assert list(stream)[-1]["status"] == "cancelled"
    assert finished(server.client, job["id"])["status"] == "cancelled"


def test_unknown_registration_has_no_stream(server: Server) -> None:
    response = server.client.get("/v1/registrations/nobody/events")
    assert response.status_code == 404
    assert response.headers["Content-Type"] == "application/problem+json"
