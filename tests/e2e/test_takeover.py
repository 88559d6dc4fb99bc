"""Code that runs in a decoder reaches its own scratch folder and nothing else."""

from __future__ import annotations

import json
import platform
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from service.workers.sandbox.confinement import missing_parts
from tests.factories.scans import arms, as_npy
from tests.factories.server import PROJECT, Server, running_server
from tests.factories.takeover.sitecustomize import MAGIC

TAKEOVER = PROJECT / "tests/factories/takeover"
CLOUD = as_npy(arms(1))
OWN = "its own scratch folder"

pytestmark = [
    pytest.mark.skipif(bool(missing_parts()), reason="this system lacks a part of the sandbox"),
    pytest.mark.skipif(platform.machine() != "x86_64", reason="numbers of system calls"),
]


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    settings = {
        "s3_buckets": "b",
        "s3_access_key_id": "id",
        "s3_secret_access_key": "secret",
        "webhook_hosts": "there",
        "webhook_secret": "secret",
        "AWS_SECRET_ACCESS_KEY": "secret",
        "PYTHONPATH": TAKEOVER,
    }
    with running_server(tmp_path_factory.mktemp("takeover"), **settings) as running:
        yield running


def attack_of(server: Server) -> bytes:
    code = (TAKEOVER / "attack.py").read_text()
    place = f"DATA_DIR = {str(server.data_dir)!r}\n"
    return MAGIC + (place + code.partition("# ruff: noqa\n")[2]).encode()


def findings(detail: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(detail[detail.index("{") : detail.rindex("}") + 1])
    return found


def test_a_decoder_that_was_taken_over_reaches_nothing(server: Server) -> None:
    server.client.put("/v1/clouds/others", content=CLOUD).raise_for_status()
    answer = server.submit(attack_of(server), CLOUD, wait=60)
    assert answer.status_code == 422, answer.text
    found = findings(answer.json()["detail"])
    assert found.pop(OWN) is not None
    assert {name: reached for name, reached in found.items() if reached is not None} == {}
    assert len(found) > 20
    assert not Path("/tmp/escaped").exists()
    assert server.client.get("/readyz").status_code == 200
