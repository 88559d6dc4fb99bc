"""Secrets that callers and operators plant are found in no log line, no answer and no callback."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import httpx
import pytest
from sqlalchemy import text

from service.database.engine import open_database
from service.settings import Settings
from tests.factories.receiver import Receiver, receiving
from tests.factories.scans import arms, as_npy
from tests.factories.server import Server, finished, running_server
from tests.factories.tenants import caller, new_key
from tests.factories.waiting import until

CLOUD = as_npy(arms(1))
SIGNATURE, TOKEN, PASSWORD = "sig-4f1c9a77", "token-9be2d031", "pass-77aa01cd"
WEBHOOK_SECRET = "hook-51d0e6b2"


class Files(BaseHTTPRequestHandler):
    """Gives the cloud to whoever sends the signature, and sends the forgetful on to it."""

    def do_GET(self) -> None:
        if SIGNATURE not in self.path:
            self.send_error(403)
            return
        if self.path.startswith("/moved"):
            self.send_response(302)
            self.send_header("Location", f"/cloud.npy?sig={SIGNATURE}")
            self.send_header("Set-Cookie", f"session={SIGNATURE}")
            self.send_header("Content-Length", "0")
            self.end_headers()
        elif self.path.startswith("/cloud"):
            self.send_response(200)
            self.send_header("Content-Length", str(len(CLOUD)))
            self.end_headers()
            self.wfile.write(CLOUD)
        else:
            self.send_error(404, f"no {self.path}")

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture(scope="module")
def files() -> Iterator[str]:
    with ThreadingHTTPServer(("127.0.0.1", 0), Files) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"127.0.0.1:{server.server_port}"
        server.shutdown()


@pytest.fixture(scope="module")
def receiver() -> Iterator[Receiver]:
    with receiving() as running:
        yield running


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with running_server(
        tmp_path_factory.mktemp("secrets"),
        require_keys=True,
        log_level="DEBUG",
        url_hosts="127.0.0.1",
        private_networks="127.0.0.0/8",
        webhook_hosts="127.0.0.1",
        webhook_secret=WEBHOOK_SECRET,
        webhook_backoff_s=0.2,
    ) as running:
        yield running


class Told:
    """A client that keeps every answer, head and body, with the secrets that went in."""

    def __init__(self, server: Server) -> None:
        self.key = new_key(server, "lab")
        self.answers: list[str] = []
        self.client = caller(server, self.key)
        self.client.event_hooks = {"response": [self._keep]}

    def _keep(self, response: httpx.Response) -> None:
        response.read()
        self.answers.append(f"{response.headers}\n{response.text}")

    def register(self, url: str, callback: str | None = None, **values: Any) -> httpx.Response:
        request = {"source": {"url": url}, "target": {"url": url}, **values}
        if callback is not None:
            request["callback_url"] = callback
        return self.client.post("/v1/registrations", json=request, headers={"Prefer": "wait=60"})


@pytest.fixture(scope="module")
def told(server: Server, files: str, receiver: Receiver) -> Iterator[Told]:
    """All that a caller hears who sends secrets wherever they can be sent."""
    told = Told(server)
    with told.client:
        good = f"http://{files}/cloud.npy?sig={SIGNATURE}#{SIGNATURE}"
        callback = f"{receiver.url}?token={TOKEN}"
        done = told.register(good, callback)
        assert finished(told.client, done.json()["id"])["status"] == "succeeded"
        told.register(f"http://{files}/moved?sig={SIGNATURE}")
        told.register(f"http://{files}/missing?sig={SIGNATURE}")
        told.register(f"http://lab:{PASSWORD}@{files}/cloud.npy?sig={SIGNATURE}")
        told.register(f"http://elsewhere.invalid/cloud.npy?sig={SIGNATURE}")
        told.register(f"http://127.0.0.1:1/cloud.npy?sig={SIGNATURE}")
        told.register(f"no-url-{SIGNATURE}")
        told.register(f"http://[{SIGNATURE}/?{SIGNATURE}")
        told.register(good, f"http://lab:{PASSWORD}@127.0.0.1/?token={TOKEN}")
        told.register(good, f"http://elsewhere.invalid/?token={TOKEN}")
        told.register(good, options={"seed": SIGNATURE, SIGNATURE: TOKEN})
        told.client.post(
            "/v1/registrations",
            content=f'{{"source": "{SIGNATURE}", {TOKEN}',
            headers={"Content-Type": "application/json"},
        )
        told.client.get(f"/v1/registrations?token={TOKEN}&limit={TOKEN}")
        told.client.get("/v1/registrations", headers={"Authorization": f"Bearer {told.key}x"})
        told.client.get("/v1/registrations", auth=("lab", PASSWORD))
        place = done.headers["Location"]
        until(lambda: receiver.received)
        for part in ("", "/deliveries", "/events", "/inliers"):
            told.client.get(place + part)
        told.client.post(f"{place}/deliveries")
        for path in ("/v1/registrations?limit=200", "/v1/capacity", "/metrics", "/openapi.json"):
            told.client.get(path)
        for job in told.client.get("/v1/registrations?limit=200").json()["items"]:
            finished(told.client, job["id"])
        yield told


def secrets(told: Told) -> list[str]:
    return [SIGNATURE, TOKEN, PASSWORD, WEBHOOK_SECRET, told.key.rpartition("_")[2]]


def test_no_answer_tells_a_secret(told: Told) -> None:
    assert len(told.answers) > 20
    for secret in secrets(told):
        assert [answer for answer in told.answers if secret in answer] == []


def test_what_is_shown_is_still_of_use(told: Told, files: str, receiver: Receiver) -> None:
    jobs = told.client.get("/v1/registrations?limit=200").json()["items"]
    first = jobs[-1]
    assert first["source"]["url"].partition("?")[0] == f"http://{files}/cloud.npy"
    assert first["callback_url"].partition("?")[0] == receiver.url


def test_no_log_line_tells_a_secret(told: Told, server: Server) -> None:
    until(lambda: server.log.count('"message": "request"') >= len(told.answers))
    assert '"level": "DEBUG"' in server.log
    for secret in secrets(told):
        assert [line for line in server.log.splitlines() if secret in line] == []


def test_no_callback_tells_the_signature(told: Told, receiver: Receiver) -> None:
    _, body = receiver.received[0]
    assert json.loads(body)["data"]["status"] == "succeeded"
    for secret in (SIGNATURE, WEBHOOK_SECRET):
        assert secret not in str(receiver.received)


def test_a_signature_is_kept_no_longer_than_it_is_needed(told: Told, server: Server) -> None:
    database = open_database(Settings(data_dir=server.data_dir).store_url)
    with database.read() as connection:
        rows = connection.execute(text("SELECT source, target, error FROM jobs")).all()
        keys = connection.execute(text("SELECT * FROM api_keys")).all()
    database.close()
    assert SIGNATURE not in str(rows)
    assert told.key.rpartition("_")[2] not in str(keys)
