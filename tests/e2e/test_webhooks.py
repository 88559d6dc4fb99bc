"""Callbacks: signed, repeated until they come through, across restarts."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.factories.receiver import Receiver, receiving
from tests.factories.scans import arms, as_npy
from tests.factories.server import Server, running_server
from tests.factories.waiting import until
from tests.factories.web import serving

CLOUD = as_npy(arms(1))
SECRET = "whsec_c3ByaW5nIHRpZGUsIG5lYXAgdGlkZQ=="


@pytest.fixture
def receiver() -> Iterator[Receiver]:
    with receiving() as running:
        yield running


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with calling_server(tmp_path_factory.mktemp("webhooks")) as running:
        yield running


def calling_server(directory: Path) -> Any:
    return running_server(
        directory,
        webhook_hosts="127.0.0.1,127.0.0.2,localhost",
        webhook_secret=SECRET,
        webhook_backoff_s=0.2,
        private_networks="127.0.0.1/32,::1/128",
    )


def submit(server: Server, url: str, **fields: str) -> dict[str, Any]:
    response = server.submit(CLOUD, CLOUD, wait=60, callback_url=url, **fields)
    assert response.status_code == 200, response.text
    return dict(response.json())


def deliveries(server: Server, job: dict[str, Any]) -> list[dict[str, Any]]:
    page = server.client.get(f"/v1/registrations/{job['id']}/deliveries").json()
    return list(page["items"])


def delivered(server: Server, job: dict[str, Any]) -> list[dict[str, Any]]:
    until(lambda: all(item["status"] == "delivered" for item in deliveries(server, job)))
    return deliveries(server, job)


def test_end_is_told_and_signed(server: Server, receiver: Receiver) -> None:
    from standardwebhooks import Webhook

    job = submit(server, receiver.url, labels='{"part": "door"}')
    receiver.wait_for(1)
    headers, body = receiver.received[0]
    event = Webhook(SECRET).verify(body, headers)  # checks the age of the time stamp, too
    assert event["type"] == "registration.succeeded"
    assert event["data"]["id"] == job["id"]
    assert event["data"]["labels"] == {"part": "door"}
    (log,) = delivered(server, job)
    assert log["id"] == headers["webhook-id"]
    assert [tried["status_code"] for tried in log["tries"]] == [204]


def test_a_refused_call_is_repeated_later_and_later(server: Server, receiver: Receiver) -> None:
    receiver.refusals = 3
    job = submit(server, receiver.url)
    receiver.wait_for(4)
    (log,) = delivered(server, job)
    assert [tried["status_code"] for tried in log["tries"]] == [503, 503, 503, 204]
    assert len({headers["webhook-id"] for headers, _ in receiver.received}) == 1


def test_a_call_can_be_replayed(server: Server, receiver: Receiver) -> None:
    job = submit(server, receiver.url)
    receiver.wait_for(1)
    replayed = server.client.post(f"/v1/registrations/{job['id']}/deliveries")
    assert replayed.status_code == 202
    receiver.wait_for(2)
    assert len(delivered(server, job)) == 2


def test_a_failed_registration_is_told_too(server: Server, receiver: Receiver) -> None:
    two_points = as_npy(arms(1, 2))
    server.submit(two_points, CLOUD, wait=60, callback_url=receiver.url)
    receiver.wait_for(1)
    event = json.loads(receiver.received[0][1])
    assert event["type"] == "registration.failed"
    assert event["data"]["error"]["type"] == "urn:mpe:problem:too-few-points"


def test_calls_survive_a_crash(tmp_path: Path, receiver: Receiver) -> None:
    with calling_server(tmp_path) as server:
        receiver.refusals = 10**6
        job = submit(server, receiver.url)
        receiver.wait_for(1)
        server.kill()
        receiver.refusals = 0
        server.start()
        (log,) = delivered(server, job)
        assert len(log["tries"]) >= 1


def test_why_no_call_came_through_is_told_without_the_query(server: Server) -> None:
    job = submit(server, "http://localhost:14999/?token=secret")
    (log,) = until(lambda: [item for item in deliveries(server, job) if item["tries"]])
    assert log["tries"][0]["status_code"] is None
    assert "cannot be reached" in log["tries"][0]["error"]
    assert "secret" not in server.client.get(f"/v1/registrations/{job['id']}").text


def test_a_redirect_is_an_answer_like_any_other(server: Server) -> None:
    with serving() as web:
        web.behaviours["/hook"] = lambda handler: handler.give(b"", 307, Location="/file")
        job = submit(server, web.url("/hook", "127.0.0.1"))
        (log,) = until(lambda: [item for item in deliveries(server, job) if item["tries"]])
        assert log["tries"][0]["status_code"] == 307
        assert "/file" not in [path for path, _ in web.requests]


def test_a_host_on_a_private_network_is_not_called(server: Server) -> None:
    response = server.submit(CLOUD, CLOUD, callback_url="http://127.0.0.2:8080/")
    assert response.status_code == 403
    assert "public network" in response.json()["detail"]


def test_other_hosts_are_not_called(server: Server) -> None:
    response = server.submit(CLOUD, CLOUD, callback_url="http://example.org/")
    assert response.status_code == 403
    assert response.json()["type"] == "urn:mpe:problem:address-refused"
    assert "MPE_WEBHOOK_HOSTS" in response.json()["detail"]


def test_nothing_to_replay_without_a_callback(server: Server) -> None:
    job = server.submit(CLOUD, CLOUD, wait=60).json()
    assert deliveries(server, job) == []
    assert server.client.post(f"/v1/registrations/{job['id']}/deliveries").status_code == 409
