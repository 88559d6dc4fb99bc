"""Attacks of one tenant that another one does not notice, and a system that starts no worker."""

from __future__ import annotations

import gzip
import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.factories.broken_start.sitecustomize import REASON
from tests.factories.logs import logged_errors
from tests.factories.receiver import receiving
from tests.factories.scans import arms, as_npy
from tests.factories.server import PROJECT, Server, finished, registered, running_server, submit
from tests.factories.tenants import caller, new_key
from tests.factories.waiting import until
from tests.factories.web import Handler, serving

CLOUD = as_npy(arms(1))
JOBS = "/v1/registrations"
SENDERS = 8
"""Callbacks that the service sends at once."""
BROKEN_START = PROJECT / "tests/factories/broken_start"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """One that calls this machine, and takes its disk for nearly full: archives do not fit."""
    directory = tmp_path_factory.mktemp("attacks")
    settings = {
        "require_keys": True,
        "workers": 1,
        "webhook_hosts": "127.0.0.1",
        "webhook_secret": "attacks",
        "private_networks": "127.0.0.1/32",
        "min_free_disk_bytes": int(0.7 * shutil.disk_usage(directory).free),
    }
    with running_server(directory, **settings) as running:
        yield running


@pytest.fixture
def attacker(server: Server) -> Iterator[httpx.Client]:
    with caller(server, new_key(server, "attacker")) as client:
        yield client


@pytest.fixture
def victim(server: Server) -> Iterator[httpx.Client]:
    with caller(server, new_key(server, "victim")) as client:
        yield client


def test_hosts_that_do_not_answer_delay_nobody_elses_callbacks(
    attacker: httpx.Client, victim: httpx.Client
) -> None:
    """Neither many registrations that call them nor replays."""
    calls = 5 * SENDERS

    def stay_silent(handler: Handler) -> None:
        handler.server.is_closing.wait(60)

    with serving() as web, receiving() as receiver:
        web.behaviours = {"/silent": stay_silent}
        url = web.url("/silent", "127.0.0.1")
        job = registered(attacker, CLOUD, CLOUD, callback_url=url)
        for _ in range(calls):  # the result is known
            submit(attacker, CLOUD, CLOUD, callback_url=url)
        replays = [attacker.post(f"{JOBS}/{job['id']}/deliveries") for _ in range(30)]
        assert {answer.status_code for answer in replays} <= {202, 429}
        registered(victim, CLOUD, CLOUD, callback_url=receiver.url)
        receiver.wait_for(1)
        assert len(web.requests) < calls


def test_an_archive_that_does_not_fit_on_the_disk_waits_and_nobody_else_does(
    server: Server, attacker: httpx.Client, victim: httpx.Client
) -> None:
    rows = b"0.5 1.25 2.75\n" * 200_000
    for content in (gzip.compress(rows), rows.decode().encode("utf-16")):
        job = submit(attacker, content, CLOUD).json()["id"]
        until(lambda: "the disk is full" in server.log)
        registered(victim, CLOUD, CLOUD, options=json.dumps({"seed": len(content)}))
        assert server.client.get("/readyz").status_code == 200
        assert attacker.get(f"{JOBS}/{job}").json()["status"] in ("queued", "running")
        attacker.delete(f"{JOBS}/{job}")
    assert not logged_errors(server.log)


def test_workers_that_cannot_start_are_told_and_recover(tmp_path: Path) -> None:
    is_broken = tmp_path / "broken"
    is_broken.touch()
    settings: dict[str, Any] = {"PYTHONPATH": BROKEN_START, "BROKEN_START": is_broken}
    with running_server(tmp_path, ready=False, **settings) as server:
        until(lambda: logged_errors(server.log))
        assert any("cannot start a process" in message for message in logged_errors(server.log))
        assert REASON in server.log
        probe = server.client.get("/readyz")
        assert probe.status_code == 503
        assert "process" in probe.json()["detail"]
        assert server.client.get("/livez").status_code == 200
        job = server.submit(CLOUD, CLOUD).json()
        is_broken.unlink()
        until(lambda: server.client.get("/readyz").status_code == 200)
        assert finished(server.client, job["id"])["status"] == "succeeded"
