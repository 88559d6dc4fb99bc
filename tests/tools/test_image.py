"""What the Dockerfile and compose.yaml promise; tools/prove_image runs them for real."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path
from urllib.parse import urlsplit

import yaml

from tools.prove_image import BASES, in_context, instructions

PROJECT = Path(__file__).parent.parent.parent
STEPS = instructions((PROJECT / "Dockerfile").read_text())


def last(keyword: str) -> str:
    return [rest for name, rest in STEPS if name == keyword][-1]


def test_steps_are_those_that_the_proof_runs() -> None:
    assert [name for name, _ in STEPS].count("FROM") == 3
    assert all(rest.partition(" AS ")[0] in BASES for name, rest in STEPS if name == "FROM")


def test_what_is_copied_is_in_the_context() -> None:
    for name, rest in STEPS:
        words = shlex.split(rest)
        if name == "COPY" and not words[0].startswith("--from="):
            for source in words[:-1]:
                assert (PROJECT / source).exists(), source
                assert in_context(source), source
    for kept_out in (".git", ".venv", "tests", "build"):
        assert not in_context(kept_out)


def test_the_service_is_confined() -> None:
    uid, _, gid = last("USER").partition(":")
    assert int(uid) > 0
    assert int(gid) > 0
    assert json.loads(last("ENTRYPOINT"))[0] == "tini"
    assert "/readyz" in last("HEALTHCHECK")
    assert last("VOLUME") == "/data"


def test_compose_can_keep_the_jobs_in_postgresql() -> None:
    services = yaml.safe_load((PROJECT / "compose.postgres.yaml").read_text())["services"]
    url = urlsplit(re.sub(r"\$\{.*\}", "pw", services["mpe"]["environment"]["MPE_DATABASE_URL"]))
    assert url.hostname in services
    assert url.username == services["postgres"]["environment"]["POSTGRES_USER"]
    assert "psycopg-binary==" in (PROJECT / "requirements.lock").read_text()


def test_compose_keeps_the_root_read_only_and_names_the_volume() -> None:
    compose = yaml.safe_load((PROJECT / "compose.yaml").read_text())
    service = compose["services"]["mpe"]
    assert service["read_only"] is True
    assert service["tmpfs"] == ["/tmp"]
    assert service["volumes"] == ["data:/data"]
    assert "data" in compose["volumes"]
    assert all(port.startswith("127.0.0.1:") for port in service["ports"])
    assert service["environment"]["MPE_ALLOWED_HOSTS"] in compose["services"]
